"""A video that is analysed in parts has the loss curves of one that is not, byte for byte."""

import dataclasses
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tracked_videos import film, smooth_planes

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.tracks.loss_curves import LossCurves, write_loss_curves
from evenlight.method.choices import AnalysisEffort
from evenlight.method.preset_files import load_display
from evenlight.stimuli.sequences import built_in_sequence
from evenlight.stimuli.video.segments import (
    SeenVideo,
    begins_of,
    curves_of_part,
    joined,
    new_contents,
    parts_of,
)
from evenlight.stimuli.video.video_analysis import VideoAnalysis
from evenlight.stimuli.video.video_file import VideoFile, open_video_file
from evenlight.stimuli.video.video_source import size_of
from evenlight.stimuli.video.viewing_geometry import seen_video

DISPLAY = load_display("varjo-xr3")
PROVENANCE = Provenance()


def moving(repeated: Sequence[int], count: int = 100) -> list[list[np.ndarray]]:
    """Planes of pictures; those of some numbers repeat the one before."""
    planes = smooth_planes(count)
    for number in repeated:
        planes[number] = planes[number - 1]
    return planes


def seen(video: VideoFile, field_of_view: float | None) -> SeenVideo:
    return SeenVideo(video, DISPLAY, field_of_view, size_of(video)[::-1])


def in_parts(video: SeenVideo, analysis: VideoAnalysis, seconds: float) -> tuple[LossCurves, list[int]]:
    parts = parts_of(video.source, seconds)
    begins = begins_of(parts, [new_contents(video, part) for part in parts])
    return joined([curves_of_part(video, analysis, a, b) for a, b in pairwise(begins)]), begins


def file_of(curves: LossCurves, path: Path) -> bytes:
    write_loss_curves(path, curves)
    return path.read_bytes()


@pytest.mark.parametrize(
    ("repeated", "codec", "field_of_view", "actuator"),
    [
        ((), "ffv1", None, Actuator.BACKLIGHT),
        ((1, 2, 3), "ffv1", 60.0, Actuator.BACKLIGHT),
        (tuple(range(20, 41)), "libx264", None, Actuator.BACKLIGHT),
        ((5, 30, 31, 60, 99), "libx264", None, Actuator.PIXELS),
        ((24, 25, 26, 49, 50, 51, 75), "ffv1", 0.5, Actuator.BACKLIGHT),  # averaged to what the display shows
    ],
)
def test_parts_of_a_video_make_the_file_that_the_whole_makes(
    tmp_path, repeated, codec, field_of_view, actuator
):
    video = open_video_file(film(tmp_path / "film.mkv", moving(repeated), codec=codec))
    analysis = VideoAnalysis(actuator=actuator, provenance=PROVENANCE, effort=AnalysisEffort(0.001))
    frames, geometry = seen_video(video.frames(), DISPLAY, field_of_view, video.name)
    whole = analysis.curves(frames, geometry, video.name)
    found, begins = in_parts(seen(video, field_of_view), analysis, 1.0)
    assert len(begins) == 5  # four parts of a second
    assert file_of(found, tmp_path / "parts.npz") == file_of(whole, tmp_path / "whole.npz")


def test_pictures_of_uneven_times_are_divided_too(tmp_path):
    stamps = np.cumsum([0, *([40] * 30), 500, *([15, 70] * 34)]).tolist()
    video = open_video_file(film(tmp_path / "film.mkv", moving((7, 8)), stamps=stamps))
    analysis = VideoAnalysis(provenance=PROVENANCE, effort=AnalysisEffort(0.001))
    frames, geometry = seen_video(video.frames(), DISPLAY, None, video.name)
    whole = analysis.curves(frames, geometry, video.name)
    found, begins = in_parts(seen(video, None), analysis, 1.0)
    assert len(begins) > 3
    assert file_of(found, tmp_path / "parts.npz") == file_of(whole, tmp_path / "whole.npz")


def test_a_part_begins_after_a_key_frame(tmp_path):
    """FFV1 has a key frame every 12 here: the encoder's default."""
    video = open_video_file(film(tmp_path / "film.mkv", moving(())))
    assert video.key_frames.tolist() == list(range(0, 100, 12))
    assert [part.start for part in parts_of(video, 1.0)] == [0, 25, 49, 73]


def test_a_short_video_and_one_whose_frames_cannot_be_sought_are_one_part(tmp_path):
    video = open_video_file(film(tmp_path / "film.mkv", moving((), 20)))
    assert parts_of(video, 0.1) == [range(20)]
    walk = built_in_sequence("house", duration=20.0, frames_per_second=10.0)
    assert parts_of(walk, 1.0) == [range(200)]


def test_a_frame_of_another_size_is_refused_in_any_part(tmp_path):
    video = open_video_file(film(tmp_path / "film.mkv", moving(())))
    other = dataclasses.replace(seen(video, None), shape=(48, 66))
    with pytest.raises(InputError, match="changes its size at frame 25 to 64x48"):
        curves_of_part(other, VideoAnalysis(), 25, 50)


@given(st.lists(st.booleans(), min_size=1, max_size=200), st.lists(st.integers(1, 199), max_size=6))
def test_every_part_begins_with_a_stretch(flags, cuts):
    """Counted frame by frame: a begin is the first frame of content 0, 16, 32, ... at or after the part's."""
    new = np.array([True, *flags[1:]])
    ends = sorted({cut for cut in cuts if cut < len(new)})
    parts = [range(a, b) for a, b in pairwise([0, *ends, len(new)])]
    begins = begins_of(parts, [new[part.start : part.stop] for part in parts])
    content, starts = -1, []
    for frame, is_new in enumerate(new):
        content += is_new
        if is_new and content % 16 == 0:
            starts.append(frame)
    assert begins[-1] == len(new)
    for part, begin in zip(parts, begins, strict=False):
        assert begin == next((start for start in starts if start >= part.start), len(new))
