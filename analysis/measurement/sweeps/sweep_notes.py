"""Results of sweeps in words: what the operator should know before using the files."""

from __future__ import annotations

import numpy as np

from evenlight.analysis.figure_style import short
from evenlight.analysis.measurement.sweeps.display_fit import tolerated
from evenlight.analysis.measurement.sweeps.luminance_sweep import LuminanceSweepFit, display_of
from evenlight.analysis.measurement.sweeps.power_fit import UNLIKELY
from evenlight.analysis.report import probability
from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.sweep_fit import DisplayFit, LuminanceSource, PowerFit, SweepFlag
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


def display_warnings(fit: DisplayFit) -> list[str]:
    """Return a sentence for each flag of a display's fit."""
    black = short(fit.black_level_interval[1])
    words = {
        SweepFlag.INCOMPLETE: "the sweep is not complete; what is there was fitted",
        SweepFlag.NOT_GAMMA: gamma_in_words(fit),
        SweepFlag.DRIFTED: f"luminance at the end was {_change(fit.drift, fit.drift_interval)} from that of "
        "the sweep; warm up longer, and keep the room's temperature",
        SweepFlag.UNSTEADY: f"the display was not steady when the sweep began: it changed by "
        f"{_change(fit.warm_up_change, fit.warm_up_interval)} in ten minutes; warm up longer",
        SweepFlag.WARM_UP_UNKNOWN: "the warm-up has too few readings to tell whether the display was steady",
        SweepFlag.REPEATS_APART: "readings of one level differ by more than 2 % and 0.02 cd/m^2; did "
        "something move, or a light change?",
        SweepFlag.BLACK_UNDER_RANGE: "black was too dark for the meter: it is only known to lie below "
        f"{black} cd/m^2",
        SweepFlag.BLACK_NEGATIVE: "black reads darker than the reflected light that was taken off; measure "
        "reflected_luminance_cd_m2 again, with the display off",
        SweepFlag.BRIGHTNESS_NOT_LINEAR: brightness_in_words(fit),
    }
    return [words[flag] for flag in fit.flags]


def gamma_in_words(fit: DisplayFit) -> str:
    """Return whether the gamma curve describes the display, in a sentence."""
    place = f"L' = {fit.largest_deviation_pixel_value:.3g}"
    where = f"a level deviates by {percent(fit.largest_deviation)} at {place}"
    if fit.lack_of_fit_p is None:
        test = "no repeats tell it from noise"
    else:
        test = f"p {_equal(fit.lack_of_fit_p)} of as much on a gamma display"
    if not fit.is_gamma:
        return f"this is not a gamma display: {where} ({test}); the optimizer will take it for one"
    if fit.lack_of_fit_p is not None and fit.lack_of_fit_p < UNLIKELY:
        return f"the gamma curve describes the display well enough: {where}, more than noise ({test})"
    return f"the gamma curve describes the display: {where} ({test})"


def brightness_in_words(fit: DisplayFit) -> str:
    """Return whether luminance is in proportion to the brightness factor, in a sentence."""
    if fit.brightness_deviation is None or fit.brightness_deviation_factor is None:
        return "no brightness factors were measured"
    where = f"{percent(fit.brightness_deviation)} at b = {fit.brightness_deviation_factor:.3g}"
    if SweepFlag.BRIGHTNESS_NOT_LINEAR in fit.flags:
        return (
            f"luminance is not in proportion to the brightness factor: {where}; give the rig brightness.csv "
            "as its backlight_curve"
        )
    return f"luminance is in proportion to the brightness factor: at most {where}"


def display_lines(fit: DisplayFit) -> list[str]:
    """Return the result of a luminance sweep in a few lines, with 95 % confidence intervals."""
    model = (
        f"display {fit.display_name}: gamma {fit.gamma:.3f} "
        f"({interval_in_words(fit.gamma_interval)}), peak {fit.peak_luminance:.4g} cd/m^2 "
        f"({interval_in_words(fit.peak_luminance_interval)}), black {fit.black_level:.3g} cd/m^2 "
        f"({interval_in_words(fit.black_level_interval, 3)})"
    )
    told = display_warnings(fit)
    words = (gamma_in_words(fit), brightness_in_words(fit))
    return [model, *(_sentence(each) for each in words if each not in told)]


def power_warnings(fit: PowerFit) -> list[str]:
    """Return a sentence for each flag of a power fit."""
    words = {
        SweepFlag.INCOMPLETE: "the sweep is not complete; what is there was fitted",
        SweepFlag.NOT_LINEAR: linearity_in_words(fit),
        SweepFlag.DRIFTED: f"at the end power was {_change(fit.drift, fit.drift_interval)} from that of the "
        f"sweep, luminance {_change(fit.luminance_drift, fit.luminance_drift_interval)}; warm up longer",
        SweepFlag.UNSTEADY: f"the display was not steady when the sweep began: it changed by "
        f"{_change(fit.warm_up_change, fit.warm_up_interval)} in ten minutes; warm up longer",
        SweepFlag.WARM_UP_UNKNOWN: "the warm-up has too few readings to tell whether the display was steady",
        SweepFlag.REPEATS_APART: "power readings of one level differ by more than 1 %; average longer",
        SweepFlag.LUMINANCE_MISSING: f"{fit.n_left_out} readings were too dark for the luminance meter, and "
        "were left out",
        SweepFlag.SAMPLES_LOST: f"the power meter lost {fit.n_lost} of {fit.n_lost + fit.n_samples} samples; "
        "lower the sample rate",
        SweepFlag.BASE_POWER_ZERO: "the best line has a base power below 0 W, within its error; it was drawn "
        "through 0 W instead",
    }
    return [words[flag] for flag in fit.flags]


def linearity_in_words(fit: PowerFit) -> str:
    """Return whether power is linear in luminance, or in the factor without a meter, in a sentence."""
    place = f"{fit.largest_deviation_luminance:.3g} cd/m^2"
    where = f"a level deviates by {percent(fit.largest_deviation)} at {place}"
    tests = []
    if fit.lack_of_fit_p is not None:
        tests.append(f"lack of fit p {_equal(fit.lack_of_fit_p)}")
    if fit.bend_p is not None:
        tests.append(f"bend {percent(fit.bend)} of the added power, p {_equal(fit.bend_p)}")
    test = "; ".join(tests) or "too few readings for a test"
    by_factor = fit.luminance_source is LuminanceSource.FACTOR
    if not fit.is_linear and by_factor:
        return (
            f"power, or the backlight's light, is not linear in the factor: {where} ({test}); a "
            "luminance meter would tell which"
        )
    if not fit.is_linear:
        droop = ", as with LED droop" if fit.bend < 0 else ""
        return f"power is not linear in luminance{droop}: {where} ({test})"
    if fit.lack_of_fit_p is None:
        return f"nothing speaks against a line, but without repeats little could: {where} ({test})"
    return f"power is linear in {'the brightness factor' if by_factor else 'luminance'}: {where} ({test})"


def power_lines(fit: PowerFit) -> list[str]:
    """Return the result of a power sweep in a few lines, with 95 % confidence intervals."""
    lines = [
        f"power of {fit.display_name}: P(L) = {fit.power_per_luminance:.4g} L + "
        f"{fit.base_power:.4g} W (slope {interval_in_words(fit.power_per_luminance_interval)} W m^2/cd, base "
        f"{interval_in_words(fit.base_power_interval)} W), up to {fit.peak_luminance:.4g} cd/m^2"
    ]
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
