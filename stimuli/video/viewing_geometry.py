"""How large a video is seen, and so how many of its pixels fill a degree.

Why this way: docs/decisions/viewing-geometry.md.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from evenlight.data_schema.arguments import number
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import ArgumentError, InputError
from evenlight.data_schema.frame import Frame
from evenlight.method.contrast.loss_curves import SMALLEST_SIDE
from evenlight.stimuli.sequence_format import NARROWEST, WIDEST
from evenlight.stimuli.video.frame_conversion import coarser

ROUNDING = 1e-9  # relative, of a field of view that is computed from pixels per degree
ROUNDED_SIZE = 1e-3  # relative, of one that is computed from a display's size and distance
PIXEL_FOR_PIXEL = 0.0  # a field of view that may be asked


def pixels_per_degree_in(field_of_view: float, width: int) -> float:
    """Return the pixels per degree in the middle of a flat picture that spans a field of view [deg].

    >>> round(pixels_per_degree_in(90.0, 640), 3)  # 320 pixels away, where a degree is 320 · π / 180
    5.585
    """
    return math.radians(width / 2 / math.tan(math.radians(field_of_view) / 2))


def field_of_view_on(display: Display, width: int) -> float:
    """Return the angle that so many pixels span on a display, pixel for pixel [deg].

    >>> round(field_of_view_on(Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=5.585), 640), 2)
    90.0
    """
    return 2 * math.degrees(math.atan(math.radians(width / 2 / display.pixels_per_degree)))


def require_angle(field_of_view: float | None) -> None:
    """Raise `ArgumentError` if that is no field of view that may be asked."""
    if field_of_view is not None and number("field_of_view", field_of_view) != PIXEL_FOR_PIXEL:
        number("field_of_view", field_of_view, NARROWEST, WIDEST)


def full_screen(display: Display, size: tuple[int, int]) -> float | None:
    """Return the angle that a video's width spans on a flat display that it fills, as far as it fits [deg].

    None, if the display's size or distance is not known, as of a headset.

    >>> tv = Display("tv", 400.0, 0.1, 2.2, 60.0, size=(1200.0, 675.0), viewing_distance=2.4)
    >>> round(full_screen(tv, (1920, 1080)), 2), round(full_screen(tv, (1440, 1080)), 2)  # bars at the sides
    (28.07, 21.24)
    """
    if display.size is None or display.viewing_distance is None:
        return None
    width = min(display.size[0], display.size[1] * size[0] / size[1])
    return 2 * math.degrees(math.atan(width / 2 / (1000 * display.viewing_distance)))


@dataclass(frozen=True, slots=True)
class ViewingGeometry:
    """How a video of some size is seen on a display.

    Attributes
    ----------
    display : Display
        At the pixels per degree of what is analysed, those in the middle of the picture.
    field_of_view : float or None
        What the width spans [deg]; None if it is shown pixel for pixel.
    size, shown_size : (int, int)
        Width and height of the video, and of what the display shows of it, where that is fewer pixels.
    """

    display: Display
    field_of_view: float | None
    size: tuple[int, int]
    shown_size: tuple[int, int]

    def __str__(self) -> str:
        words = geometry_words(self.field_of_view, self.display.pixels_per_degree)
        if self.field_of_view is None:
            words += f" ({field_of_view_on(self.display, self.size[0]):.3g}°)"
        return words

    def shown(self, frames: Iterable[Frame]) -> Iterable[Frame]:
        """Return frames as the display can show them: where it has fewer pixels, averaged to as many."""
        fewer = self.shown_size != self.size
        return coarser(frames, self.shown_size[::-1], self.display.gamma) if fewer else frames


def geometry_words(field_of_view: float | None, pixels_per_degree: float) -> str:
    """Return a geometry in words.

    >>> geometry_words(90.0, 5.5851), geometry_words(None, 72.28)
    ('at 90°, 5.59 pixels/°', 'pixel for pixel, 72.3 pixels/°')
    """
    seen = "pixel for pixel" if field_of_view is None else f"at {field_of_view:.3g}°"
    return f"{seen}, {pixels_per_degree:.3g} pixels/°"


def viewing_geometry(
    size: tuple[int, int], display: Display, field_of_view: float | None, video: str
) -> ViewingGeometry:
    """Return how a video is seen on a display.

    Parameters
    ----------
    size, display : (int, int), Display
        Width and height of the video [pixels]; what it is shown on.
    field_of_view : float or None
        What its width spans [deg], or `PIXEL_FOR_PIXEL`; None: it fills the display, if that is flat and its
        size is known, else it is shown pixel for pixel.
    video : str
        Its name, for messages.

    Raises
    ------
    InputError
        If no flat picture spans that, or too few pixels are left to analyse.
    """
    rounding = ROUNDING if field_of_view is not None else ROUNDED_SIZE
    field_of_view = full_screen(display, size) if field_of_view is None else field_of_view
    if not field_of_view:
        return ViewingGeometry(display, None, size, size)
    if not NARROWEST <= field_of_view <= WIDEST:
        within = f"in {NARROWEST:g} to {WIDEST:g} degrees"
        raise ArgumentError("field_of_view", f"must lie {within}, got {field_of_view:g}")
    (width, height), finest = size, display.pixels_per_degree
    density = pixels_per_degree_in(field_of_view, width)
    if math.isclose(density, finest, rel_tol=rounding):
        return ViewingGeometry(display, field_of_view, size, size)
    if density < finest:
        return ViewingGeometry(replace(display, pixels_per_degree=density), field_of_view, size, size)
    narrower = math.floor(width * finest / density * (1 + ROUNDING))
    share = narrower / width
    lower = round(height * share)
    if min(narrower, lower) < SMALLEST_SIDE:
        fewest = f"{narrower} pixels of the width" if narrower <= lower else f"{lower} pixels of the height"
        raise InputError(
            f"in {field_of_view:g} degrees {display.name!r} shows {fewest} of {video}, "
            f"and at least {SMALLEST_SIDE} are needed; give a wider field of view"
        )
    coarse = replace(display, pixels_per_degree=density * share)
    return ViewingGeometry(coarse, field_of_view, size, (narrower, lower))


def seen_video(
    frames: Iterator[Frame], display: Display, field_of_view: float | None, video: str
) -> tuple[Iterable[Frame], ViewingGeometry]:
    """Return the frames of a video as a display can show them, and how they are seen.

    Parameters
    ----------
    frames : iterator of Frame
        All of one size.
    display, field_of_view, video : Display, float or None, str
        As in `viewing_geometry`.
    """
    first = next(frames, None)
    if first is None:
        return frames, ViewingGeometry(display, field_of_view, (0, 0), (0, 0))
    height, width = first.shape
    geometry = viewing_geometry((width, height), display, field_of_view, video)
    return geometry.shown(itertools.chain([first], frames)), geometry
