"""A folder of images as a video: one image a frame, in the natural order of their names."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from av.error import ArgumentError, FFmpegError
from numpy.typing import NDArray

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.provenance import sha256_of_bytes, sha256_of_file
from evenlight.data_schema.storage.input_files import open_input
from evenlight.data_schema.storage.input_sizes import MOST_PIXELS, require_array_size
from evenlight.data_schema.tracks.loss_curves import UNREADABLE
from evenlight.stimuli.video.film_bytes import FilmBytes
from evenlight.stimuli.video.film_reader import prepare
from evenlight.stimuli.video.film_stream import open_alone
from evenlight.stimuli.video.frame_conversion import ColourConverter, UnsupportedColourError
from evenlight.stimuli.video.video_locations import natural_order
from evenlight.stimuli.video.video_source import FramesInALoop, rate_from_number

IMAGES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp")
ARRAYS = (".npy",)


@dataclass(frozen=True, slots=True)
class ImageFolder(FramesInALoop):
    """A folder of images, shown at a constant rate.

    Attributes
    ----------
    path : Path
        The folder.
    files : tuple of Path
        Its images in order.
    frames_per_second : float
        How many are shown in a second [Hz].
    """

    path: Path
    files: tuple[Path, ...]
    frames_per_second: float = 25.0

    def __post_init__(self) -> None:
        try:
            rate_from_number(self.frames_per_second)
        except ValueError as error:
            raise InputError(f"{self.path}: {error}") from error

    @property
    def name(self) -> str:
        """Short name for titles."""
        return self.path.resolve().name

    @property
    def n_frames(self) -> int:
        """How many images there are."""
        return len(self.files)

    @property
    def notes(self) -> tuple[str, ...]:
        """Its rate, in a line: images have none of their own."""
        return (f"{self.frames_per_second:g} images a second (`fps`)",)

    def sha256(self) -> str:
        """Return the SHA-256 of the images' names and contents, in order; other files do not count."""
        return sha256_of_bytes("".join(f"{f.name}\0{sha256_of_file(f)}\n" for f in self.files).encode())

    def frames(self) -> Iterator[Frame]:
        """Yield the images in order.

        Raises
        ------
        InputError
            As `frames_at`.
        """
        return self.frames_at(range(self.n_frames))

    def frames_at(self, numbers: Sequence[int]) -> Iterator[Frame]:
        """Yield the images of some numbers.

        Raises
        ------
        InputError
            If an image cannot be read, or differs in size from the first one.
        """
        rate = rate_from_number(self.frames_per_second)
        shape = None
        for k, file in ((k, self.files[k]) for k in numbers):
            pixels = _read_array(file) if file.suffix.lower() in ARRAYS else _read_image(file)
            if shape not in (None, pixels.shape):
                raise InputError(
                    f"{file} is {pixels.shape[1]}x{pixels.shape[0]}, the images before it are "
                    f"{shape[1]}x{shape[0]}; all images of a folder must be of one size"
                )
            shape = pixels.shape
            yield Frame(float(k / rate), float(1 / rate), pixels)


def open_image_folder(path: Path, frames_per_second: float | None = None) -> ImageFolder:
    """Return the images of a folder, in the natural order of their names.

    Parameters
    ----------
    path : Path
        The folder; files that are hidden or no images are passed over.
    frames_per_second : float, optional
        How many are shown in a second, 25 if not given [Hz].

    Raises
    ------
    InputError
        If the folder holds no image or cannot be read.
    """
    try:
        files = [f for f in path.iterdir() if f.suffix.lower() in IMAGES + ARRAYS and f.name[0] != "."]
    except OSError as error:
        raise InputError(f"cannot read the folder {path}: {error.strerror}") from error
    if not files:
        raise InputError(
            f"the folder {path} holds no images; give one with {', '.join(IMAGES + ARRAYS)} files"
        )
    files.sort(key=lambda file: natural_order(file.name))
    return ImageFolder(path, tuple(files), 25.0 if frames_per_second is None else frames_per_second)


def _read_image(file: Path) -> NDArray[Any]:
    try:
        with FilmBytes(file) as content, open_alone(content) as container:
            stream = container.streams.video[0]
            prepare(stream.codec_context)
            picture = next(container.decode(stream))
            if picture.is_corrupt:
                raise InputError(f"{file} is damaged; replace this image")
            return ColourConverter().rgb(picture)
    except UnsupportedColourError as error:
        raise InputError(f"{file} holds {error}; convert it to 8 or 16 bits, gamma-encoded") from error
    except (FFmpegError, IndexError, StopIteration, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or "it holds no image"
        if isinstance(error, ArgumentError):
            reason = f"it is no image, is damaged, or has more than {MOST_PIXELS} pixels (`large_ok`)"
        raise InputError(f"cannot read the image {file}: {reason}; replace this image") from error


def _read_array(file: Path) -> NDArray[Any]:
    try:
        with open_input(file, "an array of pixel values") as stream:
            require_array_size(stream, 3 * MOST_PIXELS, file)
            stream.seek(0)
            pixels: NDArray[Any] = np.load(stream, allow_pickle=False)
    except InputError:
        raise
    except UNREADABLE as error:
        raise InputError(f"cannot read the array {file}: {error}") from error
    if pixels.ndim == 2:
        pixels = np.repeat(pixels[..., np.newaxis], 3, axis=-1)
    if pixels.ndim != 3 or pixels.shape[2] != 3 or pixels.size == 0:
        raise InputError(
            f"{file} is of shape {pixels.shape}; an image has (height, width, 3) or (height, width)"
        )
    pixels = pixels.astype(pixels.dtype.newbyteorder("="), copy=False)
    if pixels.dtype in (np.uint8, np.uint16):
        return pixels
    if not np.issubdtype(pixels.dtype, np.floating):
        raise InputError(f"{file} holds {pixels.dtype}; pixel values are uint8, uint16 or floats in [0, 1]")
    if not np.isfinite(pixels).all():
        raise InputError(f"{file} holds values that are not finite; pixel values are in [0, 1]")
    low, high = float(pixels.min()), float(pixels.max())
    if low < 0 or high > 1:
        raise InputError(f"{file} holds values from {low:g} to {high:g}; floating pixel values are in [0, 1]")
    return pixels.astype(np.float64 if pixels.dtype == np.float64 else np.float32)
