"""The power that a film's dimmed version saves on a device: two levels and a drift, from passes in turn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from matplotlib.figure import Figure
from scipy import stats

from evenlight.analysis import figure_style as style
from evenlight.analysis.played_power.pass_power import CONFIDENCE, PassComparison
from evenlight.analysis.report import KeyFigure
from evenlight.analysis.report_prose import prose
from evenlight.analysis.results import Result
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.provenance import provenance_now, sha256_of_file
from evenlight.data_schema.recordings.instrument_logs import PowerSample
from evenlight.data_schema.recordings.played_power import DevicePass, DeviceSaving
from evenlight.data_schema.storage.tables import read_rows
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.hardware.device_passes import FEWEST_PASSES, PASSES, SAMPLES, VERSIONS, PassRequest
from evenlight.hardware.rig import is_simulated

if TYPE_CHECKING:
    import pandas as pd

TOLD = 0.8  # probability with which a saving that is called detectable is told from none
SAVING, FIGURE = "saving.json", "saving.png"


def device_saving(
    passes: Sequence[DevicePass], request: PassRequest, apparatus: dict[str, str], folder: Path
) -> DeviceSaving:
    """Return what passes say of the saving.

    Parameters
    ----------
    passes : sequence of DevicePass
        At least two of each version.
    request, apparatus, folder : PassRequest, dict, Path
        How they were measured, on what, and where the samples are.

    Raises
    ------
    InputError
        If there are too few.
    """
    comparison = PassComparison(passes, VERSIONS)
    saving = comparison.saving("dimmed")
    if saving is None or saving.degrees < 1:
        raise InputError(
            f"{folder / PASSES}: {len(passes)} passes; a saving needs {FEWEST_PASSES}, in rounds"
        )
    full, dimmed = (comparison.level(version) for version in VERSIONS)
    step = _gauge_step([sample.power for sample in read_rows(PowerSample, folder / SAMPLES)])
    rounding = step / 12**0.5 * float(np.hypot(1.0, dimmed / full)) / full
    t = stats.t(saving.degrees)
    beyond, told = (float(t.ppf((1 + CONFIDENCE) / 2)), float(t.ppf(TOLD)))
    error = saving.error or 0.0
    half = float(np.hypot(beyond * error, stats.norm.ppf((1 + CONFIDENCE) / 2) * rounding))
    return DeviceSaving(
        simulated=is_simulated(request.instrument),
        instrument=request.instrument,
        full=request.films["full"],
        dimmed=request.films["dimmed"],
        settle=request.settle,
        passes=tuple(passes),
        full_power=full,
        dimmed_power=dimmed,
        saving_percent=100 * saving.value,
        ci_low=100 * (saving.value - half),
        ci_high=100 * (saving.value + half),
        degrees_of_freedom=saving.degrees,
        detectable_percent=100 * (half + float(np.hypot(told * error, stats.norm.ppf(TOLD) * rounding))),
        drift_percent_h=100 * (comparison.drift or 0.0) / full,
        notes=prose(
            "saving_notes",
            passes=passes,
            request=request,
            planned=len(request.order()),
            step=step,
            coarse=rounding > error,
        ),
        apparatus=apparatus,
        provenance=provenance_now(inputs={name: sha256_of_file(folder / name) for name in (SAMPLES, PASSES)}),
    )


def _gauge_step(powers: Sequence[float]) -> float:
    """Return the smallest difference between values that a gauge gave, 0 W among them [W].

    >>> _gauge_step([4.9, 5.0, 5.0, 4.6])
    0.1
    """
    return round(float(np.diff(np.unique(np.round([0.0, *powers], 6))).min()), 6)


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class MeasuredSaving(Result):
    """What a dimmed film saves on the device that plays it.

    Attributes
    ----------
    saving : DeviceSaving
        Powers, saving, passes and notes.
    """

    made_by: ClassVar = "measure saving"
    saving: DeviceSaving

    @property
    def heading(self) -> str:
        """What was measured, of which film."""
        simulated = "SIMULATED power" if self.saving.simulated else "Power"
        return f"{simulated} of the device that plays {self.saving.dimmed}"

    @property
    def first_lines(self) -> tuple[str, tuple[KeyFigure, ...]]:
        """What the dimmed version saves, and what such a measurement can tell."""
        own = self.saving
        interval = f"{own.ci_low:.1f} to {own.ci_high:.1f} %"
        return prose("saving_lines", saving=own)[0], (
            KeyFigure(f"{own.saving_percent:.1f} %", "of the device's power saved", interval),
            KeyFigure(f"{own.dimmed_power:.3f} W", "dimmed", f"{own.full_power:.3f} W at full brightness"),
            KeyFigure(f"{own.detectable_percent:.1f} %", "told from none four times in five"),
        )

    @property
    def figures(self) -> Mapping[str, Figure]:
        """The power of each pass over time, by name."""
        return {"saving": _figure(self.saving, self.heading, self.first_lines[0])}

    def to_frame(self) -> pd.DataFrame:
        """Return the passes: the columns of `passes.csv`."""
        import pandas as pd

        return pd.DataFrame([mapping_from_record(one) for one in self.saving.passes])

    def write(self, folder: Path) -> None:
        """Write the saving and its figure."""
        write_json_record(folder / SAVING, self.saving)
        style.write_figure(folder / FIGURE, self.figures["saving"])


def _figure(saving: DeviceSaving, title: str, words: str) -> Figure:
    passes, start = saving.passes, saving.passes[0].begun
    per_hour = saving.drift_percent_h * saving.full_power / 100  # [W/h]
    middles = np.array([one.begun - start + one.duration / 2 for one in passes])
    ends = np.array([0.0, middles[-1] + passes[-1].duration / 2])
    drift = per_hour * (ends - middles.mean()) / 3600
    with style.look():
        figure, every = style.panels(title, words, [["passes"]], [20.0])
        axes = every["passes"]
        full = ("full", saving.full, saving.full_power, style.MUTED, "o")
        dimmed = ("dimmed", saving.dimmed, saving.dimmed_power, style.OURS, "D")
        for version, film, level, colour, marker in (full, dimmed):
            own: dict[str, Any] = {"color": colour, "marker": marker}
            is_own = np.array([one.version == version for one in passes])
            powers = [one.mean_power for one in passes if one.version == version]
            axes.plot(middles[is_own] / 60, powers, linestyle="", ms=0.5 * style.text_size(), **own)
            axes.plot(ends / 60, level + drift, color=colour)
            axes.plot([], [], label=f"{version}: {film}", **own)
        axes.set(xlabel="time [min]", ylabel="power of the device [W]", xlim=(0, ends[1] / 60))
        axes.set_ylim(0, 1.1 * max(one.mean_power for one in passes))
        style.legend_above(axes)
    return figure


def write_saving(saving: DeviceSaving, folder: Path) -> list[str]:
    """Write the saving and its figure beside the passes, and return lines that sum it up."""
    MeasuredSaving(saving).write(folder)
    return [*prose("saving_lines", saving=saving), f"saving: {folder / SAVING}, {folder / FIGURE}"]
