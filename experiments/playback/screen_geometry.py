"""At what angle a video is seen on a display, and whether that is the angle its track was made for.

Decision (docs/decisions/viewing-geometry.md): a video that knows its field of view is shown at its true size,
the middle that fits; any other pixel for pixel. A pixel of it subtends what it did in the analysis.
"""

from __future__ import annotations

from dataclasses import dataclass

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.tracks.brightness_track import TrackHeader
from evenlight.stimuli.video.video_source import VideoSource, field_of_view_of
from evenlight.stimuli.video.viewing_geometry import field_of_view_on, pixels_per_degree_in

SAME_ANGLE = 0.02  # relative: an octave of spatial frequency is 50 times as much
SAME_PIXELS = 0.01  # relative: a video this near to the display's density is shown pixel for pixel


@dataclass(frozen=True, slots=True)
class ScreenGeometry:
    """How a video lies on the visual field of someone who sees it on a display."""

    size: tuple[int, int]  # width and height of the video [pixels]
    # horizontal angle that all of it spans [deg]; None if that is not known: it is shown pixel for pixel
    field_of_view: float | None
    display: Display  # what shows it
    # pixels of the video per degree that its track was made for; None if the track does not say
    analysed: float | None

    @classmethod
    def of(
        cls, video: VideoSource, size: tuple[int, int], display: Display, header: TrackHeader
    ) -> ScreenGeometry:
        """Return that of a video of some size [pixels] on a display, by itself or else by its track."""
        analysed = header.pixels_per_degree
        if header.field_of_view is not None:  # what was averaged for the analysis has fewer pixels
            analysed = pixels_per_degree_in(header.field_of_view, size[0])
        return cls(size, field_of_view_of(video) or header.field_of_view, display, analysed)

    @property
    def pixels_per_degree(self) -> float:
        """Pixels of the video per degree as they are shown, in its middle."""
        if self.field_of_view is None:
            return self.display.pixels_per_degree
        return pixels_per_degree_in(self.field_of_view, self.size[0])

    @property
    def scale(self) -> float | None:
        """Pixels of the display per pixel of the video; None for a whole video, pixel for pixel."""
        if self.field_of_view is None:
            return None
        scale = self.display.pixels_per_degree / self.pixels_per_degree
        return 1.0 if abs(scale - 1) < SAME_PIXELS else scale

    def require_as_analysed(self, otherwise: str = "") -> None:
        """Refuse a track that was made for another angle; one that does not say for which is taken.

        Parameters
        ----------
        otherwise : str
            What else can be done about it, to be said.
        """
        if self.analysed is None or abs(self.analysed / self.pixels_per_degree - 1) <= SAME_ANGLE:
            return
        width = self.field_of_view
        seen = f"{width:.4g}° wide" if width is not None else "pixel for pixel"
        remedy = f"--field-of-view {width:.6g}" if width is not None else "this --display, pixel for pixel"
        raise InputError(
            f"the track was made for a video seen at {self.analysed:.3g} pixels per degree, and "
            f"{self.display.name!r} shows it at {self.pixels_per_degree:.3g}, {seen}: make the track again "
            f"with {remedy}{otherwise}"
        )

    def in_words(self, name: str, room: tuple[int, int], *, drawn: bool = False) -> str:
        """Return what a window of some size [pixels] shows of a video, which may be drawn for it."""
        if self.field_of_view is None or self.scale is None:
            return f"{name}: pixel for pixel, {self.pixels_per_degree:.3g} pixels per degree"
        width, height = (round(side * self.scale) for side in self.size)
        part = "all of it"
        if width > room[0]:
            sides = [field_of_view_on(self.display, room[0])]
            sides += [field_of_view_on(self.display, room[1])] if height > room[1] else []
            part = f"the middle {' × '.join(f'{side:.3g}°' for side in sides)}"
        elif height > room[1]:
            part = f"all of its width, {room[1] / height:.0%} of its height,"
        words = f"{name}: {self.field_of_view:.3g}° wide; the window shows {part} at true size"
        if self.scale == 1:
            return words
        if drawn:
            return f"{words}, drawn {self.scale:.3g} times as fine as its track was made for"
        across, down = self.display.resolution or room
        return (
            f"{words}, scaled {self.scale:.3g} times: `evenlight render` with --display and --size "
            f"{across}x{down} makes a video for it"
        )


def shown_size(size: tuple[int, int], scale: float, room: tuple[int, int]) -> tuple[int, int]:
    """Return width and height of a scaled picture, or of the middle of it that a window has room for.

    >>> shown_size((640, 360), 2.0, (1920, 700))
    (1280, 700)
    """
    width, height = (min(max(round(side * scale), 1), most) for side, most in zip(size, room, strict=True))
    return width, height
