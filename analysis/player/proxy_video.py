"""The picture of a player page: a small copy of the video, or stills where that would be too large.

Decision (docs/decisions/player-page.md): H.264 that every browser plays, of every frame at its own time,
without frames that wait for later ones: what a browser shows at a time is the frame of that time.
"""

from __future__ import annotations

import io
import math
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import av
import numpy as np
from av.video.frame import VideoFrame
from av.video.reformatter import ColorRange, Interpolation, VideoReformatter
from numpy.typing import NDArray
from PIL import Image

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.frame import Frame, LumaChroma, Pixels
from evenlight.data_schema.quantities import read_only
from evenlight.stimuli.video.frame_conversion import BT601, BT709, EXACT, LUMA_WEIGHTS, planes_of

PAGE_BYTES = 25e6  # of a page, about
PAGE_REST_BYTES = 1e6  # of it for the contrast maps and the page itself
FRAME_BYTES = 48  # of it for the plots, for each frame
MOST_LINES = (480, 360, 240)
WIDEST = 1280  # [pixels]
LEAST_RATE = 1.0  # bits a second for each pixel, below which a moving picture falls apart
MOST_RATE = 8e6  # bits a second: of noise, which nothing else needs
STILLS = 240
STILL_COLUMNS = 12
STILL_SIZE = (340, 204)  # [pixels]: a sheet of 12 is 4096 wide at most
TICK = Fraction(1, 90000)  # [s]
AHEAD, AHEAD_BYTES = 8, 200_000_000  # frames that wait to be encoded at most, and the size of them
Frames = NDArray[np.int64]  # which frames of the video, in order
_MATRICES = {LUMA_WEIGHTS[code]: code for code in (BT601, BT709)}
_PLANAR = {(1, 1): "yuv444p", (1, 2): "yuv422p", (2, 2): "yuv420p"}


@dataclass(frozen=True, slots=True, eq=False)
class Proxy:
    """A video, encoded small enough for a page."""

    data: bytes  # H.264 in MP4
    width: int  # of its picture [pixels]
    height: int
    times: Array  # when each encoded frame appears, as the file has it [s], (M,)
    frames: Frames  # which frame of the video it is, (M,)
    rate: float  # bits a second that it was allowed at most

    def __post_init__(self) -> None:
        object.__setattr__(self, "times", read_only(self.times))
        object.__setattr__(self, "frames", read_only(self.frames, np.int64))
        if len(self.times) != len(self.frames) or len(self.times) == 0:
            raise ValueError(
                f"need a time for each encoded frame, got {len(self.times)} for {len(self.frames)}"
            )


@dataclass(frozen=True, slots=True, eq=False)
class Tiles:
    """Small pictures of some frames, side by side on one sheet, row by row."""

    data: bytes  # a JPEG of stills, a PNG of contrast maps
    width: int  # of each picture [pixels]
    height: int
    columns: int  # pictures in a row of the sheet
    frames: Frames  # which frame of the video each is, (M,)

    def __post_init__(self) -> None:
        object.__setattr__(self, "frames", read_only(self.frames, np.int64))


@dataclass(frozen=True, slots=True)
class PictureFormat:
    """What of a video fits into a page."""

    width: int  # of the picture, or of each still [pixels]
    height: int
    rate: float  # bits a second at most; 0 for stills
    stride: int = 1  # every how many frames there is one


def picture_format(size: tuple[int, int], n_frames: int, seconds: float) -> PictureFormat:
    """Return the largest picture that a page has room for, of a video's width and height [pixels] and length.

    >>> picture_format((1920, 1080), 3750, 150.0)
    PictureFormat(width=854, height=480, rate=857520.0, stride=1)
    >>> picture_format((1920, 1080), 180000, 7200.0)
    PictureFormat(width=340, height=192, rate=0, stride=750)
    """
    room = 0.75 * (PAGE_BYTES - PAGE_REST_BYTES - FRAME_BYTES * n_frames)  # text takes 4 bytes for 3
    rate = min(0.9 * 8 * room / seconds, MOST_RATE)
    if "libx264" in av.codecs_available:
        for lines in MOST_LINES:
            width, height = _fitted(size, (WIDEST, lines))
            if rate >= LEAST_RATE * width * height:
                return PictureFormat(width, height, rate)
    return PictureFormat(*_fitted(size, STILL_SIZE), 0, -(-n_frames // STILLS))


def _fitted(size: tuple[int, int], most: tuple[int, int]) -> tuple[int, int]:
    """Return the largest size of a shape, in even numbers of pixels, no larger than it is."""
    share = min(1.0, *(limit / side for limit, side in zip(most, size, strict=True)))
    width, height = (max(2, min(2 * round(side * share / 2), side // 2 * 2)) for side in size)
    return width, height


class ProxyEncoder:
    """Encodes frames as H.264 in MP4, in memory; the same frames give the same bytes.

    There are about `frames_per_second`; each keeps its own time.
    """

    def __init__(self, form: PictureFormat, frames_per_second: float) -> None:
        self.form, self._file, self._reformatter = form, io.BytesIO(), VideoReformatter()
        self._container = av.open(self._file, "w", "mp4", container_options={"fflags": "+bitexact"})
        # One thread: the same bytes on every machine. No frame waits for a later one: no edit list is needed.
        options = {"preset": "superfast", "crf": "27", "bf": "0", "threads": "1", "flags": "+bitexact",
                   "maxrate": f"{form.rate:.0f}", "bufsize": f"{2 * form.rate:.0f}"}  # fmt: skip
        rate = Fraction(frames_per_second).limit_denominator(1001) or Fraction(1, 1000)
        self._stream = self._container.add_stream("libx264", rate, options)
        self._stream.width, self._stream.height = form.width, form.height
        self._stream.pix_fmt = "yuv420p"
        codec = self._stream.codec_context
        codec.time_base, codec.gop_size = TICK, max(1, round(frames_per_second))  # a seek decodes 1 s at most
        codec.color_range, codec.color_primaries, codec.color_trc = ColorRange.MPEG, BT709, BT709
        self._ticks: list[int] = []
        self._durations: dict[int, int] = {}
        self._frames: list[int] = []

    def add(self, number: int, frame: Frame) -> None:
        """Encode the next frame, of a number in the video."""
        picture = decoded(frame.pixels)
        matrix = int(picture.colorspace) if picture.format.name in _PLANAR.values() else BT709
        if not self._frames:
            self._stream.codec_context.colorspace = matrix
        small = self._reformatter.reformat(
            picture, self.form.width, self.form.height, "yuv420p",
            dst_colorspace=matrix, dst_color_range=ColorRange.MPEG,
            interpolation=Interpolation.AREA | (EXACT & ~Interpolation.BILINEAR), threads=1,
        )  # fmt: skip
        small.pts = max(round(frame.time / TICK), self._ticks[-1] + 1 if self._ticks else 0)
        small.time_base = TICK
        self._ticks.append(small.pts)
        self._frames.append(number)
        self._durations[small.pts] = max(1, round(frame.duration / TICK))
        self._write(small)

    def finished(self) -> Proxy:
        """Return the whole file."""
        self._write(None)
        self._container.close()
        times, form = np.array(self._ticks) * float(TICK), self.form
        return Proxy(self._file.getvalue(), form.width, form.height, times, np.array(self._frames), form.rate)

    def _write(self, picture: VideoFrame | None) -> None:
        for packet in self._stream.encode(picture):
            if packet.pts is not None:
                packet.duration = self._durations.pop(packet.pts)
            self._container.mux(packet)


class StillsEncoder:
    """Puts stills side by side on a sheet, as JPEG."""

    def __init__(self, form: PictureFormat) -> None:
        self.form, self._reformatter = form, VideoReformatter()
        self._stills: list[NDArray[np.uint8]] = []
        self._frames: list[int] = []

    def add(self, number: int, frame: Frame) -> None:
        """Add the next still, of a number in the video."""
        form = self.form
        small = self._reformatter.reformat(
            decoded(frame.pixel_values), form.width, form.height, "rgb24", interpolation=Interpolation.AREA
        )
        self._stills.append(np.asarray(small.to_ndarray(), np.uint8))
        self._frames.append(number)

    def finished(self) -> Tiles:
        """Return the sheet."""
        return tiles_of(self._stills, self._frames, STILL_COLUMNS, "JPEG", quality=85)


def tiles_of(
    pictures: list[NDArray[np.uint8]], frames: list[int], most_columns: int, kind: str, **options: Any
) -> Tiles:
    """Return pictures of one size, (h, w, 3), row by row on a sheet; what is left over of it is black."""
    height, width, _ = pictures[0].shape
    columns = min(most_columns, len(pictures))
    rows = -(-len(pictures) // columns)
    sheet = np.zeros((rows * height, columns * width, 3), np.uint8)
    for k, picture in enumerate(pictures):
        row, column = divmod(k, columns)
        sheet[row * height : (row + 1) * height, column * width : (column + 1) * width] = picture
    file = io.BytesIO()
    Image.fromarray(sheet).save(file, kind, **options)
    return Tiles(file.getvalue(), width, height, columns, np.array(frames))


def decoded(pixels: Pixels) -> VideoFrame:
    """Return pixels as FFmpeg takes them, in memory of their own: planes where it knows their matrix."""
    if isinstance(pixels, LumaChroma) and pixels.luma_weights in _MATRICES:
        luma, chroma, _ = pixels.planes
        down, across = (round(many / few) for many, few in zip(luma.shape, chroma.shape, strict=True))
        picture = VideoFrame(luma.shape[1], luma.shape[0], _PLANAR[down, across])
        for plane, content in zip(planes_of(picture), pixels.planes, strict=True):
            plane[:] = content
        picture.colorspace = _MATRICES[pixels.luma_weights]
        picture.color_range = ColorRange.JPEG if pixels.full_range else ColorRange.MPEG
        return picture
    values = pixels.rgb if isinstance(pixels, LumaChroma) else pixels
    if values.dtype.kind == "f":
        values = np.rint(255 * values).astype(np.uint8)
    elif values.dtype == np.uint16:
        values = ((values.astype(np.uint32) + 128) // 257).astype(np.uint8)
    return VideoFrame.from_ndarray(np.ascontiguousarray(values), "rgb24")


@contextmanager
def in_background(work: Callable[[int, Frame], None]) -> Iterator[Callable[[int, Frame], None]]:
    """Yield what has a thread of its own do the work for each frame, in order, a few frames behind at most.

    What goes wrong there is raised here; all is done at the end.
    """
    waiting: deque[Future[None]] = deque()

    def do(number: int, frame: Frame) -> None:
        each = math.prod(frame.pixels.shape) * getattr(frame.pixels, "itemsize", 1)  # bytes
        while len(waiting) >= min(AHEAD, max(1, AHEAD_BYTES // each)):
            waiting.popleft().result()
        if not isinstance(frame.pixels, LumaChroma):  # its source may fill the array again
            frame = Frame(frame.time, frame.duration, frame.pixels.copy())
        waiting.append(pool.submit(work, number, frame))

    with ThreadPoolExecutor(1, "player page") as pool:
        try:
            yield do
            while waiting:
                waiting.popleft().result()
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
