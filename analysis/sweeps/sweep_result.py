"""What follows from a sweep, luminance or power: a model for the optimizer, its levels, a figure, a page."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from evenlight.analysis.figure_style import FAINT, INK, LIMIT, MUTED, OURS, PAGE, look, panels, write_figure
from evenlight.analysis.report import Cell, KeyFigure, Picture, Report, Section, Table, write_report
from evenlight.analysis.report_prose import prose
from evenlight.analysis.report_sections import files_section, provenance_section
from evenlight.analysis.results import Result
from evenlight.analysis.sweeps.display_fit import GammaFit
from evenlight.analysis.sweeps.power_fit import LineFit
from evenlight.analysis.sweeps.repeated_readings import UNLIKELY, RelativeChange
from evenlight.analysis.sweeps.sweep_loading import Sweep
from evenlight.analysis.wording import sentence, spaced
from evenlight.data_schema.display import Display
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.power_model import PowerModel
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.recordings.sweep import SweepPhase
from evenlight.data_schema.recordings.sweep_fit import (
    DisplayFit,
    LuminanceLevel,
    PowerFit,
    SweepFlag,
)
from evenlight.data_schema.storage.tables import write_rows
from evenlight.data_schema.storage.text_files import write_json_record, write_toml_record

if TYPE_CHECKING:
    import pandas as pd

SIMULATED = "SIMULATED"
BRIGHTNESS, REPORT = "brightness.csv", "report.html"
FILES = {
    "display.toml": "the display model, for `evenlight optimize --display`",
    "power.toml": "the power model, for `evenlight optimize --power-model`",
    BRIGHTNESS: "brightness factors as they were read, for `backlight_curve` of a rig",
    "display_fit.json": "coefficients, confidence intervals, tests, flags and levels, for programs",
    "power_fit.json": "coefficients, confidence intervals, tests, flags and levels, for programs",
    "luminance.png": "the figure of this page",
    "power.png": "the figure of this page",
}
SIZE = PAGE.font_size  # [point], to which marks and lines are in proportion
BAND: dict[str, Any] = {"color": OURS, "alpha": 0.12, "linewidth": 0, "zorder": 0}
LUMINANCE = "luminance L [cd/m²]"
PHASES = {
    SweepPhase.WARM_UP: ("s", MUTED, "warm-up"),
    SweepPhase.SWEEP: ("o", INK, "sweep"),
    SweepPhase.DRIFT: ("D", OURS, "repeat at the end"),
}
Fit = TypeVar("Fit", DisplayFit, PowerFit)
Coefficient = tuple[str, Cell, Cell, str]


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class SweepResult(Result):
    """What was made of a sweep.

    Attributes
    ----------
    sweep : Sweep
        The readings that count.
    model, record : Display or PowerModel, DisplayFit or PowerFit
        What the optimizer takes, and how far it can be trusted.
    brightness : tuple of LuminanceLevel
        Of a luminance sweep: brightness factors as they were read, `brightness.csv`; the levels beside the
        model are the record's.
    draw : (callable, callable)
        Draw what was read, and what the fit misses.
    coefficients : tuple of (str, Cell, Cell, str)
        Quantity, value, 95 % confidence interval and unit: three of the model, then what tells of its trust.
    remarks, tables : tuple of str, tuple of Table
        What else is to be said, and shown.
    """

    made_by: ClassVar = "fit"
    sweep: Sweep[Any]
    model: Display | PowerModel
    record: DisplayFit | PowerFit
    draw: tuple[Callable[[Axes], None], Callable[[Axes], None]]
    coefficients: tuple[Coefficient, ...]
    remarks: tuple[str, ...]
    tables: tuple[Table, ...] = ()
    brightness: tuple[LuminanceLevel, ...] = ()

    @property
    def name(self) -> str:
        """What was measured: luminance or power."""
        return "power" if isinstance(self.model, PowerModel) else "luminance"

    @property
    def heading(self) -> str:
        """What was measured of which display."""
        return f"{self.name.capitalize()} of {self.record.display_name}"

    @property
    def first_lines(self) -> tuple[str, tuple[KeyFigure, ...]]:
        """Whether the model describes what was read, and its numbers."""
        begin = ["Look at the warnings first."] if self.warnings else []
        lead = " ".join([*begin, *(f"{_in_report(words)}." for words in _verdicts(self.record))])
        cards = (
            KeyFigure(f"{value}{'' if unit == '1' else f' {unit}'}", quantity, f"{interval or ''}")
            for quantity, value, interval, unit in self.coefficients[:3]
        )
        return lead.replace(" %", "\u00a0%"), (*cards, _trust(self.record))

    @property
    def figures(self) -> Mapping[str, Figure]:
        """The figure, by name."""
        with look():
            mosaic, heights = [["A", "B"], ["C", "C"]], [18.0, 12.0]
            figure, axes = panels(self.heading, _in_report(self._model), mosaic, heights, apart=6.0)
            for panel, draw in zip("AB", self.draw, strict=True):
                draw(axes[panel])
            _draw_over_time(axes["C"], self.sweep, self.name)
        return {self.name: figure}

    @property
    def lines(self) -> tuple[str, ...]:
        """What came out, for the terminal, with 95 % confidence intervals; without what is a warning."""
        told = warnings_of(self.record)
        verdicts = (sentence(words) for words in _verdicts(self.record) if words not in told)
        of = "power of" if self.name == "power" else "display"
        return (f"{of} {self.record.display_name}: {self._model}", *verdicts, *self.remarks)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to look at before the files are used."""
        return (*warnings_of(self.record), *self.sweep.warnings)

    @property
    def _model(self) -> str:
        return _words(f"sweep_{self._stem}", self.record)

    @property
    def _stem(self) -> str:
        return "power" if isinstance(self.model, PowerModel) else "display"

    def to_frame(self) -> pd.DataFrame:
        """Return the levels as they were read beside the model: the rows of its tables."""
        import pandas as pd

        rows = (*self.record.levels, *self.brightness)
        return pd.DataFrame([mapping_from_record(row) for row in rows])

    def write(self, folder: Path) -> None:
        """Write the model, tables, coefficients, the figure and the report."""
        stem, picture = self._stem, f"{self.name}.png"
        columns = ("quantity", "value", "interval", "unit")
        model = Table(f"The {stem} model, with 95 % confidence intervals.", columns, self.coefficients)
        png = write_figure(folder / picture, self.figures[self.name])
        write_toml_record(folder / f"{stem}.toml", self.model)
        if self.brightness:
            write_rows(folder / BRIGHTNESS, LuminanceLevel, self.brightness)
        write_json_record(folder / f"{stem}_fit.json", self.record)
        names = (f"{stem}.toml", *([BRIGHTNESS] if self.brightness else []), f"{stem}_fit.json", picture)
        sections = (
            Section(
                "The panel" if stem == "power" else "The display",
                paragraphs=tuple(f"{_in_report(words).removesuffix('.')}." for words in self.remarks),
                tables=(model, *self.tables),
                pictures=(Picture(png, prose(f"sweep_{self.name}_caption")[0]),),
                notes=tuple(_in_report(words) for words in self.warnings),
                simulated=self.record.simulated,
                methods=prose("sweep_measured", manifest=self.sweep.manifest, fit=self.record),
            ),
            provenance_section({f"{stem} model": self.record.provenance}),
            files_section({name: FILES[name] for name in names}),
        )
        (lead, cards), simulated = self.first_lines, prose("sweep_simulated")[0]
        write_report(folder / REPORT, Report(self.heading, lead, sections, simulated, key_figures=cards))


def fit_record(
    cls: type[Fit],
    model: GammaFit | LineFit,
    sweep: Sweep[Any],
    changes: tuple[RelativeChange, RelativeChange],
    flags: Mapping[SweepFlag, bool],
    **own: Any,
) -> Fit:
    """Return the record of a fit.

    Parameters
    ----------
    cls : type
        `DisplayFit` or `PowerFit`.
    model : GammaFit or LineFit
        What was fitted; what it has in common with the record is taken over.
    sweep : Sweep
        The readings that count.
    changes : (RelativeChange, RelativeChange)
        At the end of the sweep, and late in the warm-up.
    flags : mapping of SweepFlag to bool
        What is so, of what only this kind of sweep can tell.
    **own
        What else this kind of record has.
    """
    names = {field.name for field in fields(cls)} & {field.name for field in fields(model)}
    manifest, (drift, warm_up) = sweep.manifest, changes
    display = manifest.display_name
    if manifest.simulated and SIMULATED not in display:
        display += f" ({SIMULATED})"
    raised = {
        SweepFlag.INCOMPLETE: not sweep.complete,
        SweepFlag.DRIFTED: drift.is_large,
        SweepFlag.UNSTEADY: warm_up.is_large,
        SweepFlag.WARM_UP_UNKNOWN: warm_up.is_vague,
        SweepFlag.STALE_READINGS: sweep.n_stale > 0,
        SweepFlag.SUSPECT_READINGS: bool(sweep.suspects),
        **flags,
    }
    return cls(
        display_name=display,
        session_id=manifest.session_id,
        simulated=manifest.simulated,
        drift=drift.share,
        drift_interval=drift.interval,
        warm_up_change=warm_up.share,
        warm_up_interval=warm_up.interval,
        flags=tuple(flag for flag in SweepFlag if raised.get(flag)),
        provenance=provenance_now(seed=manifest.provenance.seed, inputs=sweep.inputs),
        suspects=sweep.suspects,
        n_stale=sweep.n_stale,
        **{name: getattr(model, name) for name in names},
        **own,
    )


def source_of(sweep: Sweep[Any], record: DisplayFit | PowerFit, read: str, misfit: str) -> dict[str, Any]:
    """Return the fields of a model that say where it comes from.

    Parameters
    ----------
    sweep, record : Sweep, DisplayFit or PowerFit
        The readings that count, and what was fitted to them.
    read, misfit : str
        What was read, and what the display is not; empty if the model describes it.
    """
    if sweep.left_out:
        read += f"; suspect readings left out: {len(sweep.left_out)}"
    if misfit:
        read += f"; {misfit}, a level deviates by {_signed_percent(record.largest_deviation)}"
    return {
        "name": record.display_name,
        "source": f"{SIMULATED} {read}" if record.simulated else read,
        "measured": "" if record.simulated else sweep.manifest.started,
        "provenance": record.provenance,
    }


def _trust(fit: DisplayFit | PowerFit) -> KeyFigure:
    """Return the card of the warnings, or of the largest deviation if there are none."""
    if fit.flags:
        what = "warning" if len(fit.flags) == 1 else "warnings"
        beside = ", ".join(spaced(flag.value) for flag in fit.flags)
        return KeyFigure(str(len(fit.flags)), what, beside, warns=True)
    deviation = _signed_percent(fit.largest_deviation)
    if isinstance(fit, PowerFit):
        where = f"at {fit.largest_deviation_luminance:.3g} cd/m²"
        return KeyFigure(deviation, "largest deviation from the line", where)
    where = f"at L′ = {fit.largest_deviation_pixel_value:.3g}"
    return KeyFigure(deviation, "largest deviation from the curve", where)


def in_percent(share: float | None, interval: tuple[float, float] | None) -> tuple[Cell, Cell]:
    """Return a change and its interval for two cells [%]."""
    if share is None or interval is None:
        return None, None
    low, high = (100 * end for end in interval)
    return f"{100 * share:.2f}", f"{low:.2f} to {high:.2f}"


def interval_in_words(interval: Sequence[float], digits: int = 4) -> str:
    """Return an interval in words.

    >>> interval_in_words((0.29, 0.3012345))
    '0.29 to 0.3012'
    """
    low, high = interval
    return f"{low:.{digits}g} to {high:.{digits}g}"


def _in_report(words: str) -> str:
    return sentence(words).replace("^2", "²")


def _signed_percent(share: float) -> str:
    return f"{100 * share:+.1f} %"


def _change(share: float | None, interval: tuple[float, float] | None) -> str:
    if share is None or interval is None:
        return "not measured"
    low, high = interval
    return f"{_signed_percent(share)} ({_signed_percent(low)} to {_signed_percent(high)})"


def _words(template: str, fit: DisplayFit | PowerFit, flag: str = "") -> str:
    return prose(
        template,
        fit=fit,
        flag=flag,
        of_power=isinstance(fit, PowerFit),
        unlikely=UNLIKELY,
        interval=interval_in_words,
        percent=_signed_percent,
        change=_change,
    )[0]


def warnings_of(fit: DisplayFit | PowerFit) -> tuple[str, ...]:
    """Return a sentence for each flag of a fit."""
    return tuple(_words("sweep_flags", fit, flag.value) for flag in fit.flags)


def _verdicts(fit: DisplayFit | PowerFit) -> Sequence[str]:
    """Return whether the model describes what was read, in a sentence or two."""
    templates = ("sweep_linearity",) if isinstance(fit, PowerFit) else ("sweep_gamma", "sweep_brightness")
    return [_words(template, fit) for template in templates]


def _draw_over_time(axes: Axes, sweep: Sweep[Any], quantity: str) -> None:
    """Draw the readings that tell of warm-up and drift over time, each from its level's mean in the sweep.

    They are of levels that were read outside of the sweep too. A level whose mean is 0 tells nothing.
    """
    value = attrgetter(quantity)
    levels = sorted({r.level for r in sweep.readings if r.phase is not SweepPhase.SWEEP})
    swept = {level: sweep.repeats(SweepPhase.SWEEP, value, level) for level in levels}
    means = {level: own.mean for level, own in swept.items() if own.values.size and own.mean > 0}
    if not means:
        axes.set_axis_off()
        words = "Neither a warm-up nor a repeat at the end was read."
        axes.text(0.0, 1.0, words, color=MUTED, va="top", transform=axes.transAxes)
        return
    for phase, (mark, colour, label) in PHASES.items():
        own = [(sweep.repeats(phase, value, level), mean) for level, mean in means.items()]
        minutes = np.concatenate([read.times / 60 for read, _ in own])
        percents = np.concatenate([100 * (read.values / mean - 1) for read, mean in own])
        if minutes.size:
            axes.plot(minutes, percents, mark, color=colour, ms=0.36 * SIZE, mew=0, zorder=3, label=label)
    axes.axhline(0, color=FAINT, linewidth=SIZE / 11, zorder=1)
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, -1.2), max(high, 1.2))  # so that noise does not look large
    name = f"C  Warm-up and drift of {quantity}"
    name_panel(axes, name, "time since the sweep began [min]", "from its level's mean [%]")


def draw_points(axes: Axes, x: ArrayLike, y: ArrayLike, half: ArrayLike) -> None:
    """Draw the means of levels and their intervals."""
    bars: dict[str, Any] = {"capsize": 0.2 * SIZE, "elinewidth": SIZE / 10, "capthick": SIZE / 10}
    label = "level mean, 95 %"
    axes.errorbar(x, y, yerr=half, fmt="o", color=INK, ms=0.42 * SIZE, label=label, zorder=4, **bars)


def draw_suspects(axes: Axes, out: Iterable[tuple[float, float | None]]) -> None:
    """Draw the readings that were left out and have a value."""
    read = [place for place in out if place[1] is not None]
    if read:
        dots: dict[str, Any] = {"color": LIMIT, "ms": 0.6 * SIZE, "clip_on": False, "zorder": 5}
        axes.plot(*zip(*read, strict=True), "x", label="suspect, left out", **dots)


def name_panel(axes: Axes, name: str, x: str, y: str, **legend: Any) -> None:
    """Write what a panel shows above it and at its axes, and put its legend into a corner."""
    axes.set_title(name, loc="left", pad=0.7 * SIZE, fontweight="bold")
    axes.set(xlabel=x, ylabel=y)
    axes.legend(borderaxespad=0.6, **legend)
