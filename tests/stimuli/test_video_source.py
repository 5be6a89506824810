"""Claims about opening videos by name: which of several get the frame rate that is given."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.sequences import open_video, open_videos


@pytest.fixture
def film(tmp_path: Path, make_video: Callable[..., Any]) -> str:
    path = tmp_path / "a.mkv"
    make_video(path, np.linspace(0.2, 0.8, 4), (32, 24), 2.0)
    return str(path)


def test_a_frame_rate_goes_to_the_clips_that_tell_none(film: str) -> None:
    first, second = open_videos([film, "sunrise"], 0.1)
    assert first.sha256() == open_video(film).sha256()
    assert second.n_frames == open_video("sunrise", 0.1).n_frames
    assert second.n_frames != open_video("sunrise").n_frames


def test_a_frame_rate_that_no_clip_takes_is_refused(film: str) -> None:
    with pytest.raises(InputError, match="has its own frame rate"):
        open_videos([film, film], 0.1)
