"""What a headset's runtime says of it, and how long its frames last: for the person who writes its rig."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from itertools import pairwise

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Rig
from evenlight.hardware.presentation.headset_window import ShownFrame
from evenlight.hardware.rig_windows import open_headset


def measure_headset(rig: Rig, frames: int) -> list[str]:
    """Return what the headset of a rig says of itself, line by line; the last one says how its frames came.

    Parameters
    ----------
    rig : Rig
        A rig in a headset.
    frames : int
        How many frames are timed.

    Raises
    ------
    InputError
        If the rig is not in a headset, or what a headset needs is missing.
    InstrumentError
        If there is no headset, or its runtime goes away.
    """
    if not rig.in_headset:
        raise InputError(
            f'the rig {rig.name!r} shows on screen {rig.screen}: name one with screen = "openxr" (or the '
            "preset `headset`)"
        )
    with open_headset(rig) as window:
        window.begin(rig.eye)
        for _ in range(frames):
            window.framebuffer().clear(0.0, 0.0, 0.0, 1.0)
            window.flip()
        shown, facts = window.shown_frames(), window.facts()
        said = [f"{name.replace('_', ' '):<25} {value}" for name, value in window.apparatus().items()]
    tracks = "orientation and position" if facts.tracks_position else "orientation"
    known = sum(frame.tracked for frame in shown)
    rates = ", ".join(f"{rate:g}" for rate in facts.refresh_rates) or "unknown"
    return [
        *said,
        f"{'tracks':<25} {tracks}; known in {known} of {len(shown)} frames",
        "",
        "For a rig's file:",
        f'screen = "{rig.screen}"',
        f'eye = "{rig.eye.value}"  # the one whose luminance counts',
        "full_screen = true  # each eye has the recommended {} x {} pixels".format(*facts.eye_size),
        f"refresh_rate_hz = {facts.refresh_rate:.2f}  # can be chosen: {rates}",
        "",
        _timed(shown),
    ]


def _timed(shown: Sequence[ShownFrame]) -> str:
    """Return how frames followed each other, of two or more."""
    period = statistics.median(after.display_time - before.display_time for before, after in pairwise(shown))
    return (
        f"{len(shown)} frames, {sum(frame.visible for frame in shown)} of them shown: {1e3 * period:.2f} ms "
        f"from one to the next ({1 / period:.2f} Hz), {sum(frame.late for frame in shown)} refreshes without "
        "a new one"
    )
