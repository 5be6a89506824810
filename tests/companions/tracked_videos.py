"""Videos of every kind that a camera or an editor makes, and tracks that fit them."""

from collections.abc import Iterator, Sequence
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from av.video.frame import VideoFrame
from example_tracks import example_track, header_of

from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.tracks.brightness_track import (
    write_track,
)
from evenlight.method.preset_files import load_display
from evenlight.stimuli.sequences import open_video
from evenlight.stimuli.video.frame_conversion import planes_of
from evenlight.stimuli.video.video_file import VideoFile

DISPLAY = load_display("varjo-xr3")
BT601 = (1, 6, 6, 6)  # limited range; matrix, primaries, transfer function


def track_of(video: Path | str, folder: Path, factors: Sequence[float] | None = None) -> np.ndarray:
    """Write a track of a video, rising from 0.4 to 0.7 if nothing else is said; return its factors."""
    source = open_video(str(video))
    count = source.n_frames
    assert count is not None
    if isinstance(source, VideoFile):
        times = source.timeline.times[source.timeline.durations > 0]
    else:
        times = np.array([frame.time for frame in source.frames()])
    b = np.linspace(0.4, 0.7, count) if factors is None else np.asarray(factors)
    made = provenance_now(inputs={"video": source.sha256()})
    header = header_of(DISPLAY, video=source.name, provenance=made, display=DISPLAY)
    rate = np.append(np.sign(np.diff(b)), 0.0)
    folder.mkdir(parents=True, exist_ok=True)
    seen = {"mean_luminance": 0.5 * b * DISPLAY.peak_luminance, "rate": rate, "rate_limit": 1.0}
    write_track(folder / "track.csv", example_track(b, times=times, header=header, **seen))
    return b


def film(
    path: Path,
    pictures: Sequence[Sequence[np.ndarray]],
    pixel_format: str = "yuv420p",
    stamps: Sequence[int] | None = None,
    tags: tuple[int, int, int, int] = BT601,
    codec: str = "ffv1",
    **more: object,
) -> Path:
    """Write planes of pictures at some times of a clock of 1/1000 s; `more` is rotation and pixel aspect."""
    stamps = range(0, 40 * len(pictures), 40) if stamps is None else stamps
    with av.open(str(path), "w") as container:
        options = {"qp": "0", "g": "12"} if codec == "libx264" else {}
        stream = container.add_stream(codec, rate=25, options=options)
        stream.height, stream.width = pictures[0][0].shape
        stream.pix_fmt = pixel_format
        context = stream.codec_context
        context.time_base = Fraction(1, 1000)
        context.color_range, context.colorspace, context.color_primaries, context.color_trc = tags
        if "aspect" in more:
            context.sample_aspect_ratio = more["aspect"]
        if "rotation" in more:
            stream.set_display_rotation(more["rotation"])
        for planes, stamp in zip(pictures, stamps, strict=True):
            picture = VideoFrame(stream.width, stream.height, pixel_format)
            for place, plane in zip(planes_of(picture), planes, strict=True):
                place[:] = plane
            picture.color_range, picture.colorspace, picture.color_primaries, picture.color_trc = tags
            picture.pts, picture.time_base = stamp, Fraction(1, 1000)
            container.mux(stream.encode(picture))
        container.mux(stream.encode())
    return path


def smooth_planes(
    count: int, size: tuple[int, int] = (64, 48), layout: str = "420"
) -> list[list[np.ndarray]]:
    """Y, Cb, Cr of smooth pictures that move, of 8 bits; all of their R, G, B are in [0, 1]."""
    across, down = (2 if layout in ("420", "422") else 1), (2 if layout == "420" else 1)
    width, height = size

    def wave(w: int, h: int, k: int, low: float, high: float) -> np.ndarray:
        rows, columns = np.mgrid[:h, :w]
        value = 0.5 + 0.5 * np.sin(2 * np.pi * (columns / w + rows / h + k / 10))
        return np.rint(low + (high - low) * value).astype(np.uint8)

    return [
        [
            wave(width, height, k, 60, 190),
            wave(width // across, height // down, k + 3, 118, 138),
            wave(width // across, height // down, k + 6, 118, 138),
        ]
        for k in range(count)
    ]


def decoded_planes(path: Path) -> Iterator[list[np.ndarray]]:
    """Yield the planes of a file's pictures as they are decoded."""
    with av.open(str(path)) as container:
        for picture in container.decode(video=0):
            yield [plane.astype(np.float64) for plane in planes_of(picture)]
