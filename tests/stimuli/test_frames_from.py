"""Frames that are sought are those that come when a video is read from its beginning, bit for bit."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from evenlight.stimuli.sequences import built_in_sequence
from evenlight.stimuli.video import video_file
from evenlight.stimuli.video.image_folder import open_image_folder
from evenlight.stimuli.video.video_file import VideoFile, open_video_file
from evenlight.stimuli.video.video_source import VideoSource, frames_at, frames_from

N = 40
NUMBERS = (0, 1, 9, 11, 12, 13, 23, 25, 39)  # about the key frames, every twelfth
ENCODERS = {
    "closed": ("a.mp4", "libx264", {"x264-params": "keyint=12:min-keyint=12:scenecut=0:bframes=3"}),
    "open": ("b.mkv", "libx264", {"x264-params": "keyint=12:min-keyint=12:scenecut=0:bframes=3:open-gop=1"}),
    "without key frames": ("c.mp4", "libx264", {"x264-params": "keyint=12:intra-refresh=1:bframes=0"}),
    "mpeg2": ("d.mkv", "mpeg2video", {"g": "12", "bf": "2"}),
    "avi": ("e.avi", "mpeg4", {"g": "12", "bf": "2"}),
    "lossless": ("f.mkv", "ffv1", {"g": "12"}),
}


def written(path: Path, codec: str, options: dict[str, str]) -> VideoFile:
    noise = np.random.default_rng(1).integers(0, 255, (64, 96, 3), dtype=np.uint8)
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=Fraction(25), options=options)
        stream.width, stream.height, stream.pix_fmt = 96, 64, "yuv420p"
        for k in range(N):
            picture = av.VideoFrame.from_ndarray(np.roll(noise, 3 * k, axis=1), "rgb24")
            container.mux(stream.encode(picture.reformat(format="yuv420p")))
        container.mux(stream.encode())
    return open_video_file(path)


def require_the_same(video: VideoSource, numbers: tuple[int, ...]) -> None:
    every = [(frame.time, frame.pixel_values.tobytes()) for frame in video.frames()]
    for number in numbers:
        rest = [(frame.time, frame.pixel_values.tobytes()) for frame in frames_from(video, number)]
        assert rest == every[number:]
    found = [(frame.time, frame.pixel_values.tobytes()) for frame in frames_at(video, numbers)]
    assert found == [every[number] for number in numbers]


@pytest.mark.parametrize("kind", ENCODERS)
def test_frames_of_a_file(kind: str, tmp_path: Path) -> None:
    name, codec, options = ENCODERS[kind]
    require_the_same(written(tmp_path / name, codec, options), NUMBERS)


def test_what_lies_before_the_last_key_frame_is_not_decoded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, codec, options = ENCODERS["closed"]
    video, decoded = written(tmp_path / name, codec, options), []
    decode = VideoFile._decoded

    def counted(*arguments: object, **options: object):
        for picture in decode(*arguments, **options):
            decoded.append(picture.pts)
            yield picture

    monkeypatch.setattr(video_file.VideoFile, "_decoded", counted)
    next(video.frames_at([30]))
    assert len(decoded) == 30 - 24 + 1


def test_frames_of_a_folder_and_of_a_sequence(tmp_path: Path) -> None:
    for k in range(4):
        np.save(tmp_path / f"{k}.npy", np.full((8, 8, 3), k, np.uint8))
    require_the_same(open_image_folder(tmp_path), (0, 2, 3))
    require_the_same(built_in_sequence("checkerboard", (16, 16), 0.4), (0, 3, 9))  # it cannot be sought
