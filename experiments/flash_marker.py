"""Three flashes of the whole screen, which are found again in the power of a meter that has no other mark."""

from __future__ import annotations

from typing import Protocol

from evenlight.experiments.showing import Showing
from evenlight.method.luminance import dimmed_luminance
from evenlight.stimuli.field_renderer import Field, FieldRenderer
from evenlight.stimuli.ramp import frame_count

FLASHES = 3
FLASH_SECONDS = 0.5  # bright, and dark between
DARK, BRIGHT = 0.2, 1.0  # brightness factors of the white screen


class FlashWatcher(Protocol):
    """Who takes note of the flashes."""

    def flashed(self, factor: float) -> None:
        """Take note of a brightness factor right after it first appeared."""

    def take_samples(self) -> None:
        """Take what a meter has measured meanwhile, after every refresh."""


def flash(on: Showing, fields: FieldRenderer, watcher: FlashWatcher) -> None:
    """Show three flashes of white, dark before and after each.

    Parameters
    ----------
    on : Showing
        What is shown on.
    fields : FieldRenderer
        Draws the field.
    watcher : FlashWatcher
        Who takes note of them.
    """
    refresh = 0
    for factor in (*(DARK, BRIGHT) * FLASHES, DARK):
        for number in range(frame_count(FLASH_SECONDS, on.rig.refresh_rate)):
            pixels = on.brightness.of_picture(factor)
            white = float(dimmed_luminance(on.display.peak_luminance, pixels, on.display))
            on.show(fields, Field(white), refresh)
            refresh += 1
            if number == 0:
                watcher.flashed(factor)
            else:
                watcher.take_samples()
