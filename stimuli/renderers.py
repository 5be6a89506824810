"""Which renderers draw into a window: those of a screen, or those of a headset's eyes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.rig import Dither
from evenlight.stimuli.eyes.eye_renderer import EyeFieldRenderer, EyeImageRenderer
from evenlight.stimuli.eyes.surfaces import Surface
from evenlight.stimuli.field_renderer import FieldRenderer
from evenlight.stimuli.image_renderer import ImageRenderer

if TYPE_CHECKING:
    from evenlight.hardware.protocols import Window

AnyFieldRenderer = FieldRenderer | EyeFieldRenderer
AnyImageRenderer = ImageRenderer | EyeImageRenderer


def field_renderer(window: Window, display: Display, dither: Dither) -> AnyFieldRenderer:
    """Return what draws fields into a window.

    Parameters
    ----------
    window : Window
        On a screen, or in a headset.
    display : Display
        What is drawn on.
    dither : Dither
        How luminances between two codes are drawn.
    """
    if window.eyes() is not None:
        return EyeFieldRenderer(window, display, dither)
    return FieldRenderer(window.context(), display, window.bits(), dither)


def image_renderer(
    window: Window, display: Display, dither: Dither, surface: Surface | None = None
) -> AnyImageRenderer:
    """Return what draws images into a window.

    Parameters
    ----------
    window, display, dither : Window, Display, Dither
        As of `field_renderer`.
    surface : FlatScreen or Sphere, optional
        In a headset, what an image that is for both eyes lies on; a flat screen where it is not said.
    """
    if window.eyes() is not None:
        return EyeImageRenderer(window, display, dither, surface)
    return ImageRenderer(window.context(), display, window.bits(), dither)
