"""The measured power of a played video: each version's average, as the paper's power table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from evenlight.analysis.measurement.played_power.clock_fit import fit_clock
from evenlight.analysis.measurement.played_power.clock_line import line_of
from evenlight.analysis.measurement.played_power.pass_power import (
    ENOUGH,
    PassComparison,
    equal_power,
    frame_energies,
    frame_spans,
    pass_powers,
    version_powers,
)
from evenlight.analysis.measurement.played_power.power_recording import (
    Recording,
    count_samples,
)
from evenlight.analysis.measurement.played_power.power_words import notes_of
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.power_model import PanelKind, PowerModel
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.played_power import FrameEnergy, PassPower, PlayedPower, VersionPower

FAR_OFF = 0.1  # of what a power model predicts


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredPower:
    """What was measured of a played video.

    Attributes
    ----------
    power : PlayedPower
        Passes, versions, clock.
    energies : sequence of FrameEnergy
        The frames.
    """

    power: PlayedPower
    energies: Sequence[FrameEnergy]


def measure_power(
    recording: Recording, power_model: PowerModel | None = None, origin: Provenance | None = None
) -> MeasuredPower:
    """Return energies of frames and average powers of versions.

    Parameters
    ----------
    recording : Recording
        What was played and sampled.
    power_model : PowerModel, optional
        Whose prediction is shown beside it.
    origin : Provenance, optional
        Where the recording comes from.

    Raises
    ------
    InputError
        If no pass was measured well enough.
    """
    log = recording.log
    clock = fit_clock(recording)
    spans = frame_spans(recording.flips, log.refresh_rate)
    energies = frame_energies(recording.samples, spans, line_of(clock))
    passes = pass_powers(energies, recording.flips, log)
    predict, model_notes = _prediction(power_model)
    comparison = PassComparison(passes)
    versions = version_powers(energies, comparison, predict)
    if not versions:
        raise InputError(_nothing_measured(recording, passes))
    samples = count_samples(recording.samples, recording.n_duplicated)
    full = next((one.mean_power for one in versions if one.version == "full"), None)
    power = PlayedPower(
        simulated=log.simulated,
        video=log.video,
        duration=log.duration,
        refresh_rate=log.refresh_rate,
        sample_rate=log.sample_rate,
        clock=clock,
        samples=samples,
        passes=passes,
        versions=versions,
        equal_power=equal_power(comparison, full),
        drift_w_h=comparison.drift,
        power_model="" if power_model is None else power_model.name,
        notes=(
            *notes_of(log, clock, samples, energies, passes),
            *model_notes,
            *_misfit(versions, power_model),
        ),
        provenance=origin or Provenance(),
    )
    return MeasuredPower(power, energies)


def _prediction(model: PowerModel | None) -> tuple[Callable[[float], float] | None, tuple[str, ...]]:
    """Return what a model predicts of a mean factor, and what to say where it cannot."""
    if model is None:
        return None, ()
    if model.kind is PanelKind.OLED:
        return None, (
            f"The power model {model.name} is of an OLED panel, whose power goes with the content: it "
            "predicts nothing from the brightness factor alone.",
        )
    slope = model.power_per_luminance * model.peak_luminance
    return lambda factor: model.base_power + slope * factor, ()


def _misfit(versions: Sequence[VersionPower], model: PowerModel | None) -> tuple[str, ...]:
    """Return what to say of a model that is far off: it is probably another panel's."""
    ratios = [v.mean_power / v.predicted_power for v in versions if v.predicted_power and v.mean_power > 0]
    if model is None or not ratios or max(abs(ratio - 1) for ratio in ratios) <= FAR_OFF:
        return ()
    return (
        f"What was measured is {100 * min(ratios):.0f} to {100 * max(ratios):.0f} % of what the power model "
        f"{model.name} predicts; is it of this panel?",
    )


def _nothing_measured(recording: Recording, passes: Sequence[PassPower]) -> str:
    """Return why no pass counts."""
    best = max(one.measured_share for one in passes)
    samples, flips = recording.samples, recording.flips
    lasted = float(samples.device_time[-1] - samples.device_time[0])
    played = float(flips.flip[-1] - flips.flip[0])
    return (
        f"{recording.where}: no pass has power for {100 * ENOUGH:.0f} % of the video (at most "
        f"{100 * best:.0f} %); samples came for {lasted:.3g} s, and {played:.3g} s were "
        "played. Measure again, with the meter on from the first marker to the last"
    )
