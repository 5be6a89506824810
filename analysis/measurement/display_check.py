"""Whether a display's file still holds: the curve that it has, against the one that was measured now."""

from __future__ import annotations

import numpy as np

from evenlight.analysis.measurement.display_fit import tolerated
from evenlight.analysis.measurement.luminance_sweep import LuminanceSweepFit, display_of
from evenlight.data_schema.display import Display
from evenlight.method.luminance import displayed_luminance

PIXEL_VALUES = np.linspace(0.0, 1.0, 65)


def compared_with_file(known: Display, measured: Display) -> str:
    """Return how a measured display differs from its file, and whether the file still holds, in a sentence.

    It holds if the two curves, reflected light left out, differ nowhere by more than is tolerated of a gamma
    curve: 2 % and 0.02 cd/m².

    >>> known = Display("desk", 200.0, 0.2, 2.2, pixels_per_degree=40.0)
    >>> compared_with_file(known, Display("desk", 202.0, 0.2, 2.2, pixels_per_degree=40.0))
    "The file of 'desk' still holds: peak +1.0 %, gamma +0.000, black +0.00 cd/m^2 from it"
    """
    old, new = (
        displayed_luminance(PIXEL_VALUES, display) - display.reflected_luminance
        for display in (known, measured)
    )
    holds = bool((np.abs(new - old) <= tolerated(old)).all())
    verdict = "still holds" if holds else "no longer holds"
    peak = 100 * (measured.peak_luminance / known.peak_luminance - 1)
    gamma, black = measured.gamma - known.gamma, measured.black_level - known.black_level
    since = f" ({known.measured[:10]})" if known.measured else ""
    return (
        f"The file of {known.name!r}{since} {verdict}: peak {_signed(peak, 1)} %, "
        f"gamma {_signed(gamma, 3)}, black {_signed(black, 2)} cd/m^2 from it"
    )


def _signed(change: float, decimals: int) -> str:
    """Return a change with its sign; 0.0 is added for -0.0, which reads as less than nothing.

    >>> _signed(-0.0006, 3), _signed(-0.0006, 2)
    ('-0.001', '+0.00')
    """
    return f"{round(change, decimals) + 0.0:+.{decimals}f}"


def against_file(result: LuminanceSweepFit) -> tuple[str, ...]:
    """Return the sentence of `compared_with_file`, or none where the display had no file."""
    known = result.sweep.manifest.display
    return () if known is None else (compared_with_file(known, display_of(result)),)
