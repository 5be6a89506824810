"""Gains of the online controller, chosen for a video within margins of stability.

    python -m benchmarks.tune_gains film-online/loss_curves.npz --target-loss 0.03 --out tuning.json

reads the loss curves that `evenlight control` or `evenlight optimize` wrote. `evenlight control` and
`evenlight walk` take the gains from `--proportional`, `--integral`, `--derivative` and `--gain-rate`.
They are tuned for the fitted rate limit at each frame's mean luminance alone: not for another luminance that
the limit may be about, and without allowances. How they are found: docs/decisions/online-controller.md.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.controller_tuning import MarginRequirements, Margins, content_slopes, rms_error, tune
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.provenance import Provenance, provenance_now
from evenlight.data_schema.quantities import count, described, quantity, record, share
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.data_schema.tracks.loss_curves import LossCurves, read_loss_curves
from evenlight.method.contrast.curve_lookup import loss_and_slope
from evenlight.method.online.control_curves import ControlledTrack, control_curves
from evenlight.method.online.controller import Controller, ControllerSettings
from evenlight.method.preset_files import load_rate_limit
from evenlight.method.rate_limit import scalar_rate_limit


@record
class LoopReport:
    """Gains of the controller, how far its loop is from ringing, and what it does with the content."""

    proportional: float = quantity("1", "proportional gain K_p", minimum=0.0)
    integral: float = quantity("1", "integral gain K_i", minimum=0.0)
    derivative: float = quantity("1", "derivative gain K_d", minimum=0.0)
    stable_slope: float | None = quantity(
        "1",
        "slope of the loss over the factor up to which the loop is stable; null for gains of 0",
        minimum=0.0,
    )
    gain_margin_db: float | None = quantity(
        "dB", "gain margin in dB, at the slope of the content; null where there is none"
    )
    phase_margin: float | None = quantity(
        "deg", "phase margin at the slope of the content; null where there is none"
    )
    sensitivity_peak: float | None = quantity(
        "1", "largest amplification of a wave in the content's loss; null for an unstable loop"
    )
    sd_loss: float = quantity("1", "standard deviation of the loss over time", minimum=0.0)
    rms_error: float = quantity("1", "root mean square of loss - target over time", minimum=0.0)
    share_limited: float = share("share of the time in which the rate limit or a bound held the factor back")


@record
class TuningReport:
    """Gains tuned on some content, with margins of stability: `tuning.json`."""

    video: str = described("name of the video that the gains were tuned on")
    target_loss: float = share("target c_r: contrast loss to hold")
    gain_rate: float = quantity("Hz", "frame rate that the gains are for", above=0.0)
    frame_rate: float = quantity("Hz", "frame rate of the video, which the margins are for", above=0.0)
    quantile: float = share(
        "quantile of the frames, by the steepest slope of their loss, that the margins are for"
    )
    slope: float = quantity("1", "slope of the loss at that quantile", above=0.0)
    steepest_slope: float = quantity("1", "steepest slope of any frame", minimum=0.0)
    least_gain_margin_db: float = quantity("dB", "least gain margin to be kept, in dB", minimum=0.0)
    least_phase_margin: float = quantity("deg", "least phase margin to be kept", minimum=0.0)
    before: LoopReport = described("the loop with the gains that were given")
    after: LoopReport = described("the loop with the gains that were found")
    tries: int = count("runs over the content that the search took")
    provenance: Provenance = described("how the file was made")


def tuning_report(curves: LossCurves, controller: Controller) -> TuningReport:
    """Return the gains for a video, its margins, and what they do beside those that the controller has."""
    demands, frame_rate = MarginRequirements(), 1 / float(np.median(curves.durations))
    tuned = tune(curves, controller)
    given, found = controller.settings, tuned.settings
    slopes = content_slopes(curves, found.target_loss, found.lowest_factor)
    before, after = (
        _loop(own, margins, control_curves(curves, replace(controller, settings=own)))
        for own, margins in ((given, tuned.margins_before), (found, tuned.margins))
    )
    return TuningReport(
        video=curves.video,
        target_loss=found.target_loss,
        gain_rate=found.gain_rate or frame_rate,
        frame_rate=frame_rate,
        quantile=demands.quantile,
        slope=tuned.slope,
        steepest_slope=float(slopes.max()),
        least_gain_margin_db=20 * math.log10(demands.gain_margin),
        least_phase_margin=demands.phase_margin,
        before=before,
        after=after,
        tries=tuned.tries,
        provenance=provenance_now(inputs=curves.provenance.inputs),
    )


def _loop(settings: ControllerSettings, margins: Margins, run: ControlledTrack) -> LoopReport:
    return LoopReport(
        proportional=settings.proportional,
        integral=settings.integral,
        derivative=settings.derivative,
        stable_slope=_finite(margins.stable_slope),
        gain_margin_db=_finite(margins.gain_margin_db),
        phase_margin=margins.phase_margin,
        sensitivity_peak=_finite(margins.sensitivity_peak),
        sd_loss=_sd(run.time_share, run.contrast_loss),
        rms_error=rms_error(run),
        share_limited=min(float(run.time_share @ run.limited), 1.0),
    )


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _sd(share: Array, loss: Array) -> float:
    return math.sqrt(float(share @ (loss - share @ loss) ** 2))


def at_target(curves: LossCurves, controller: Controller, target: float) -> tuple[float, float, float, float]:
    """Return mean factor, mean loss, its SD over time, and that of constant dimming by the mean factor."""
    settings = replace(controller.settings, target_loss=target)
    run = control_curves(curves, replace(controller, settings=settings))
    mean = min(run.mean_factor, 1.0)
    constant = loss_and_slope(curves, np.full(curves.n_frames, mean))[0]
    share = run.time_share
    return mean, float(share @ run.contrast_loss), _sd(share, run.contrast_loss), _sd(share, constant)


def main(arguments: Sequence[str] | None = None) -> None:
    """Tune gains, write `tuning.json`, and say what other targets take with them."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.tune_gains", description=__doc__)
    parser.add_argument("curves", type=Path, help="loss_curves.npz of a result")
    parser.add_argument("--target-loss", type=float, required=True, help="contrast loss to hold, 0 to 1")
    parser.add_argument("--rate-limit", default="surace2025", help="a preset, or rate_limit.json")
    parser.add_argument("--targets", type=float, nargs="*", default=(), help="targets to try with the gains")
    parser.add_argument("--out", type=Path, required=True, help="tuning.json")
    asked = parser.parse_args(arguments)
    curves = read_loss_curves(asked.curves)
    limit = scalar_rate_limit(load_rate_limit(asked.rate_limit), curves.display.reflected_luminance)
    settings = ControllerSettings(asked.target_loss, lowest_factor=float(curves.factors[0]))
    found = tuning_report(curves, Controller(settings, limit))
    write_json_record(asked.out, found)
    before, after = found.before, found.after
    print(
        f"K_p {after.proportional:.4g}, K_i {after.integral:.4g}, K_d {after.derivative:.4g} for frames of "
        f"1/{found.gain_rate:.4g} s; root mean square error {100 * before.rms_error:.2g} points with the "
        f"paper's gains, {100 * after.rms_error:.2g} with these: {asked.out}"
    )
    gains = {name: getattr(after, name) for name in ("proportional", "integral", "derivative")}
    tuned = Controller(replace(settings, **gains), limit)
    for target in asked.targets:
        factor, loss, sd, constant = at_target(curves, tuned, target)
        print(
            f"target {100 * target:.3g} %: mean factor {factor:.4g}, mean loss {100 * loss:.2g} %, SD "
            f"{100 * sd:.2g} points, {100 * constant:.2g} at constant dimming"
        )


if __name__ == "__main__":
    main()
