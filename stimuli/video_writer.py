"""Video files without loss: FFV1 in Matroska, whole or not at all."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import av
import numpy as np
from av.error import FFmpegError
from av.video.frame import VideoFrame
from numpy.typing import NDArray

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.storage.whole_files import written_whole
from evenlight.stimuli.video.film_stream import FIELD_OF_VIEW
from evenlight.stimuli.video.video_source import rate_from_number

if TYPE_CHECKING:
    from av.container import OutputContainer
    from av.video.stream import VideoStream

FORMATS = {8: "bgr0", 10: "gbrp10le", 12: "gbrp12le", 16: "gbrp16le"}
# Version 3 with checksums: a damaged file is noticed. Every frame stands alone.
FFV1_OPTIONS = {"level": "3", "slicecrc": "1", "g": "1"}


def write_video(
    path: Path,
    frames: Iterable[Frame | NDArray[Any]],
    frames_per_second: float,
    bits: int | None = None,
    field_of_view: float | None = None,
) -> int:
    """Write frames without loss, and return how many there were.

    Parameters
    ----------
    path : Path
        The file, ending in .mkv; it is there whole at the end, or not at all.
    frames : iterable of Frame or array, (height, width, 3), uint8 or uint16
        Gamma-encoded R, G, B over the full range of the integer type, all of one size.
    frames_per_second : float
        Constant frame rate [Hz].
    bits : int, optional
        Bits a channel: 8, 10, 12 or 16; those of the first frame's type if not given. Fewer bits than
        the type holds are lossless only for values that lie on their grid, as those of the built-in
        sequences do for 10 bits.
    field_of_view : float, optional
        Angle that the width is to span for the viewer [deg]; the file's tag `FIELD_OF_VIEW`.

    Raises
    ------
    InputError
        If the file cannot be written, or there is no frame.
    """
    if path.suffix.lower() != ".mkv":
        raise InputError(f"cannot write {path}: lossless video is Matroska, give a name that ends in .mkv")
    if path.is_dir():
        raise InputError(f"cannot write {path}: it is a folder, give the name of a file")
    rate = rate_from_number(frames_per_second)
    arrays = (frame.pixel_values if isinstance(frame, Frame) else frame for frame in frames)
    written = 0
    with (
        told_by_name(path),
        written_whole(path, wait=0.0) as partial,
        new_container(partial) as container,
    ):
        if field_of_view is not None:
            container.metadata[FIELD_OF_VIEW] = f"{field_of_view:.17g}"
        stream = None
        for array in arrays:
            if stream is None:
                depth = bits or 8 * array.dtype.itemsize
                stream = container.add_stream("ffv1", rate=rate, options=FFV1_OPTIONS)
                stream.height, stream.width = array.shape[:2]
                stream.pix_fmt = FORMATS[depth]
            container.mux(stream.encode(_picture(array, depth, stream)))
            written += 1
        if stream is None:
            raise InputError(f"no frames to write to {path}")
        container.mux(stream.encode())
    return written


def new_container(path: Path) -> OutputContainer:
    """Open a file to be written, without a random identifier: same frames, same bytes."""
    return av.open(f"file:{path}", "w", container_options={"fflags": "+bitexact"})


@contextmanager
def told_by_name(path: Path) -> Iterator[None]:
    """Name the file that cannot be written."""
    try:
        yield
    except (OSError, FFmpegError) as error:
        raise InputError(f"cannot write {path}: {error.strerror or error}") from error


def _picture(pixels: NDArray[Any], bits: int, stream: VideoStream) -> VideoFrame:
    if pixels.dtype not in (np.uint8, np.uint16) or (bits == 8) != (pixels.dtype == np.uint8):
        raise ValueError(f"need uint8 for 8 bits and uint16 for more, got {pixels.dtype} for {bits} bits")
    if pixels.shape != (stream.height, stream.width, 3):
        raise ValueError(f"need frames of shape {(stream.height, stream.width, 3)}, got {pixels.shape}")
    if bits == 8:
        return VideoFrame.from_ndarray(np.ascontiguousarray(pixels), "rgb24").reformat(format=FORMATS[8])
    top = 2**bits - 1
    codes = pixels if bits == 16 else ((pixels.astype(np.uint32) * top + 32767) // 65535).astype(np.uint16)
    return VideoFrame.from_ndarray(np.ascontiguousarray(codes), FORMATS[bits])
