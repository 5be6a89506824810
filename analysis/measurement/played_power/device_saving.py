"""The power that a film's dimmed version saves on a device: two levels and a drift, from passes in turn."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from scipy import stats

from evenlight.analysis.figure_style import (
    MUTED,
    OURS,
    PAGE,
    axes_at,
    heading_lines,
    legend_above,
    lines_at,
    look,
    new_figure,
    png_bytes,
    text_size,
)
from evenlight.analysis.measurement.played_power.pass_power import CONFIDENCE, PassComparison
from evenlight.analysis.report_prose import prose
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import provenance_now, sha256_of_file
from evenlight.data_schema.recordings.device_saving import DevicePass, DeviceSaving
from evenlight.data_schema.recordings.instrument_logs import PowerSample
from evenlight.data_schema.storage.tables import read_rows
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.data_schema.storage.whole_files import write_whole
from evenlight.hardware.device_passes import FEWEST_PASSES, PASSES, SAMPLES, VERSIONS, PassRequest
from evenlight.hardware.rig import is_simulated

TOLD = 0.8  # probability with which a saving that is called detectable is told from none
SAVING, FIGURE = "saving.json", "saving.png"
STYLES: dict[str, dict[str, Any]] = {
    "full": {"color": MUTED, "marker": "o"},
    "dimmed": {"color": OURS, "marker": "D"},
}


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
    step = gauge_step([sample.power for sample in read_rows(PowerSample, folder / SAMPLES)])
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


def gauge_step(powers: Sequence[float]) -> float:
    """Return the smallest difference between values that a gauge gave, 0 W among them [W].

    >>> gauge_step([4.9, 5.0, 5.0, 4.6])
    0.1
    """
    return round(float(np.diff(np.unique(np.round([0.0, *powers], 6))).min()), 6)


def write_saving(saving: DeviceSaving, folder: Path) -> list[str]:
    """Write the saving and its figure beside the passes, and return lines that sum it up."""
    write_json_record(folder / SAVING, saving)
    write_whole(folder / FIGURE, png_bytes(saving_figure(saving)))
    return [*prose("saving_lines", saving=saving), f"saving: {folder / SAVING}, {folder / FIGURE}"]


def saving_figure(saving: DeviceSaving) -> Figure:
    """Draw the power of each pass over time, and the fitted levels with their drift."""
    hours = saving.drift_percent_h * saving.full_power / 100
    start = saving.passes[0].begun
    middles = [(one.begun - start + one.duration / 2) for one in saving.passes]
    centre = sum(middles) / len(middles)
    with look(PAGE):
        em = PAGE.em
        title = (
            f"{'SIMULATED power' if saving.simulated else 'Power'} of the device that plays {saving.dimmed}"
        )
        lines, above = heading_lines(title, prose("saving_lines", saving=saving)[0], PAGE.width - 6 * em, em)
        top, height = above + 2.4 * em, 20 * em
        figure = new_figure(PAGE, top + height + 3.8 * em)
        lines_at(figure, 5.0 * em, lines)
        axes = axes_at(figure, 5.0 * em, top, PAGE.width - 6.2 * em, height)
        ends = [0.0, middles[-1] + saving.passes[-1].duration / 2]
        for version, level in zip(VERSIONS, (saving.full_power, saving.dimmed_power), strict=True):
            own = [
                (t / 60, one.mean_power)
                for t, one in zip(middles, saving.passes, strict=True)
                if one.version == version
            ]
            axes.plot(*zip(*own, strict=True), linestyle="", ms=0.5 * text_size(), **STYLES[version])
            axes.plot(
                [t / 60 for t in ends],
                [level + hours * (t - centre) / 3600 for t in ends],
                color=STYLES[version]["color"],
            )
        axes.set(xlabel="time [min]", ylabel="power of the device [W]", xlim=(0, ends[1] / 60))
        axes.set_ylim(0, 1.1 * max(one.mean_power for one in saving.passes))
        handles = [
            Line2D([], [], label=f"{version}: {name}", **STYLES[version])
            for version, name in zip(VERSIONS, (saving.full, saving.dimmed), strict=True)
        ]
        legend_above(axes, handles=handles)
    return figure
