"""How a video is seen in a headset: on a flat screen in the dark, on a sphere, or drawn for both eyes."""

from __future__ import annotations

from dataclasses import replace

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.tracks.brightness_track import TrackHeader
from evenlight.experiments.playback.play_options import HeadsetOptions, Projection, refuse
from evenlight.experiments.playback.screen_geometry import ScreenGeometry
from evenlight.stimuli.eyes.surfaces import FlatScreen, Sphere, Surface
from evenlight.stimuli.scenes.scene_sequence import SceneSequence
from evenlight.stimuli.video.video_source import VideoSource
from evenlight.stimuli.video.viewing_geometry import field_of_view_on

NARROWEST, WIDEST = 1.0, 150.0  # [deg] of a flat screen


def seen_in_headset(
    video: VideoSource, size: tuple[int, int], display: Display, header: TrackHeader, options: HeadsetOptions
) -> tuple[ScreenGeometry, Surface | None]:
    """Return at what angle a video is seen, and what it lies on; None for a scene, which is drawn.

    Without a field of view a flat screen is as wide as the track was made for; of a video side by side, as
    wide as shows a pixel of each half at that angle.

    Parameters
    ----------
    video, size : VideoSource, (int, int)
        The video, its width and height [pixels].
    display, header : Display, TrackHeader
        The headset's display, and what its track says of itself.
    options : HeadsetOptions
        What is asked for.

    Raises
    ------
    InputError
        If an option cannot be, or nothing says how wide the screen is to be.
    """
    geometry = ScreenGeometry.of(video, size, display, header)
    if isinstance(video, SceneSequence):
        refuse("{} is for videos; a scene is drawn for both eyes of a headset, at its true size", options)
        return geometry, None
    width = size[0] // 2 if options.side_by_side else size[0]
    geometry = replace(geometry, size=(width, size[1]))
    if options.projection in (Projection.HALF, Projection.WHOLE):
        refuse("{} is for --projection flat", options, "screen_field_of_view")
        span = float(options.projection.value)
        finest = replace(display, pixels_per_degree=width / span)
        sphere = Sphere(span, side_by_side=options.side_by_side)
        return replace(geometry, field_of_view=None, display=finest), sphere
    asked = options.screen_field_of_view
    if asked is None:
        asked = _analysed_field_of_view(geometry)
    if not NARROWEST <= asked <= WIDEST:
        raise InputError(
            f"a flat screen in a headset is {NARROWEST:g} to {WIDEST:g} degrees wide, got {asked:.4g}: "
            "give another --screen-field-of-view"
        )
    return replace(geometry, field_of_view=asked), FlatScreen(asked, side_by_side=options.side_by_side)


def _analysed_field_of_view(geometry: ScreenGeometry) -> float:
    """Return how wide a screen is that shows a video at the angle its track was made for [deg]."""
    density = geometry.analysed
    if density is None:
        raise InputError(
            "the track does not say at what angle its video is to be seen: give --screen-field-of-view"
        )
    return field_of_view_on(replace(geometry.display, pixels_per_degree=density), geometry.size[0])


def require_as_analysed(geometry: ScreenGeometry, surface: Surface | None, otherwise: str) -> None:
    """Refuse a track that was made for another angle than that at which a headset shows its video.

    A scene is drawn as wide and as fine as the headset is: that is said, and not compared.

    Parameters
    ----------
    geometry, surface
        As `seen_in_headset` returns them.
    otherwise : str
        What else can be done about it, to be said.
    """
    if surface is None:
        return
    density = geometry.pixels_per_degree
    if isinstance(surface, Sphere):
        otherwise = f", with pixels_per_degree = {density:.4g} in its file{otherwise}"
    elif geometry.analysed is not None:
        fits = _analysed_field_of_view(geometry)
        otherwise = f", show it with --screen-field-of-view {fits:.4g}{otherwise}"
    geometry.require_as_analysed(otherwise)


def words_of(name: str, geometry: ScreenGeometry, surface: Surface | None, density: float) -> str:
    """Return what a headset of some pixels per degree shows of a video.

    >>> lab = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=20.0)
    >>> words_of("film", ScreenGeometry((1920, 1080), 60.0, lab, None), FlatScreen(60.0), 20.0)
    'film: on a flat screen 60° wide, 29 pixels per degree, and the headset has 20'
    """
    if surface is None:
        made = "" if geometry.analysed is None else f", its track was made for {geometry.analysed:.3g}"
        return (
            f"{name}: drawn for both eyes at its true size, as wide as the headset sees, {density:.3g} "
            f"pixels per degree{made}"
        )
    if isinstance(surface, Sphere):
        where = f"sphere, {surface.span:.3g}° around the head"
    else:
        where = f"flat screen {geometry.field_of_view:.3g}° wide"
    halves = ", a half of the video for each eye" if surface.side_by_side else ""
    finest = f"{geometry.pixels_per_degree:.3g} pixels per degree, and the headset has {density:.3g}"
    return f"{name}: on a {where}, {finest}{halves}"
