"""A search on a computer without a display is refused at once, before its scenes are lit."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evenlight.experiments.viewing import search_task
from evenlight.stimuli.scenes.content.catalogue import path_named


def test_without_a_display_nothing_is_computed(
    tmp_path: Path, make_stimulus: Callable[..., None], command: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def lit(*_: object) -> None:
        pytest.fail("the places of the rings were computed")

    monkeypatch.setattr(search_task, "search_points", lit)
    monkeypatch.delenv("DISPLAY", raising=False)
    make_stimulus(tmp_path / "walks" / "library", np.full(round(5 * path_named("library").duration), 0.5))
    design = tmp_path / "my.search.design.toml"
    design.write_text('sequences = ["library"]\n')
    words = ["--participant", "01", "--session", "01", "--rig", "simulated", "--simulate", "visual"]
    words += ["--stimuli", str(tmp_path / "walks"), "--design", str(design), "--out", str(tmp_path / "lab")]
    outcome = command("run", "search", *words)
    assert outcome.code == 2
    assert "no display: the environment variable DISPLAY is not set" in outcome.err
    assert outcome.err.count("\n") == 1
    assert not (tmp_path / "lab").exists()
