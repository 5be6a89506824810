"""Results of sweeps in words: what the operator should know before using the files."""

from __future__ import annotations

import numpy as np

from evenlight.analysis.figure_style import short
from evenlight.analysis.measurement.sweeps.display_fit import tolerated
from evenlight.analysis.measurement.sweeps.luminance_sweep import LuminanceSweepFit, display_of
from evenlight.analysis.measurement.sweeps.power_fit import UNLIKELY
from evenlight.analysis.measurement.sweeps.suspects import in_words
from evenlight.analysis.report import probability
from evenlight.analysis.report_prose import prose
from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.sweep_fit import DisplayFit, PowerFit, SweepFlag
from evenlight.method.contrast.luminance import displayed_luminance

PIXEL_VALUES = np.linspace(0.0, 1.0, 65)


def interval_in_words(interval: tuple[float, float], digits: int = 4) -> str:
    """Return an interval in words.

    >>> interval_in_words((0.29, 0.3012345))
    '0.29 to 0.3012'
    """
    low, high = interval
    return f"{low:.{digits}g} to {high:.{digits}g}"


def percent(share: float) -> str:
    """Return a share in percent, with its sign.

    >>> percent(0.0123), percent(-0.5)
    ('+1.2 %', '-50.0 %')
    """
    return f"{100 * share:+.1f} %"


def _change(share: float | None, interval: tuple[float, float] | None) -> str:
    """Return a change with its interval in words."""
    if share is None or interval is None:
        return "not measured"
    return f"{percent(share)} ({percent(interval[0])} to {percent(interval[1])})"


def _words(template: str, fit: DisplayFit | PowerFit, flag: str = "") -> str:
    """Return a sentence about a fit, from its template."""
    return prose(
        template,
        fit=fit,
        flag=flag,
        of_power=isinstance(fit, PowerFit),
        unlikely=UNLIKELY,
        interval=interval_in_words,
        percent=percent,
        change=_change,
        equal=_equal,
        short=short,
        suspects=in_words(fit.suspects),
    )[0]


def warnings_of(fit: DisplayFit | PowerFit) -> list[str]:
    """Return a sentence for each flag of a fit."""
    return [_words("sweep_flags", fit, flag.value) for flag in fit.flags]


def gamma_in_words(fit: DisplayFit) -> str:
    """Return whether the gamma curve describes the display, in a sentence."""
    return _words("sweep_gamma", fit)


def brightness_in_words(fit: DisplayFit) -> str:
    """Return whether luminance is in proportion to the brightness factor, in a sentence."""
    return _words("sweep_brightness", fit)


def linearity_in_words(fit: PowerFit) -> str:
    """Return whether power is linear in luminance, or in the factor without a meter, in a sentence."""
    return _words("sweep_linearity", fit)


def display_lines(fit: DisplayFit) -> list[str]:
    """Return the result of a luminance sweep in a few lines, with 95 % confidence intervals."""
    told = warnings_of(fit)
    words = (gamma_in_words(fit), brightness_in_words(fit))
    return [_words("sweep_display", fit), *(_sentence(each) for each in words if each not in told)]


def power_lines(fit: PowerFit) -> list[str]:
    """Return the result of a power sweep in a few lines, with 95 % confidence intervals."""
    lines = [_words("sweep_power", fit)]
    return lines if SweepFlag.NOT_LINEAR in fit.flags else [*lines, _sentence(linearity_in_words(fit))]


def _equal(p: float) -> str:
    """Return a probability after its sign of relation.

    >>> _equal(0.3), _equal(1e-5)
    ('= 0.30', '< 0.01')
    """
    text = probability(p)
    return text if text.startswith("<") else f"= {text}"


def _sentence(words: str) -> str:
    """Return words that begin with a capital letter."""
    return words[0].upper() + words[1:]


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
