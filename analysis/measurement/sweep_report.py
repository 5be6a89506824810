"""The report of a sweep: one page that says what the display is like, and how far that can be trusted."""

from __future__ import annotations

from collections.abc import Mapping

from evenlight.analysis.measurement.display_check import against_file
from evenlight.analysis.measurement.luminance_sweep import LuminanceSweepFit
from evenlight.analysis.measurement.power_sweep import PowerSweepFit
from evenlight.analysis.measurement.sweep_notes import (
    brightness_in_words,
    display_lines,
    display_warnings,
    gamma_in_words,
    interval_in_words,
    linearity_in_words,
    power_lines,
    power_warnings,
)
from evenlight.analysis.report import Cell, Picture, Report, Section, Table
from evenlight.analysis.report_sections import files_section, provenance_section
from evenlight.data_schema.sweep import SweepManifest
from evenlight.data_schema.sweep_fit import DisplayFit, LuminanceLevel, LuminanceSource, PowerFit

SIMULATED_SWEEP = (
    "Simulated: the readings come from a simulated display, or by a simulated instrument. They show how the "
    "procedure works and say nothing about a display."
)
CURVE_CAPTION = (
    "A: luminance of each pixel value, mean and 95 % interval, and the gamma curve. B: what the curve "
    "misses; shaded is what is tolerated. C: readings of levels that were read in the warm-up or at the end "
    "too, over time. D: luminance of each brightness factor, from that in proportion to it."
)
LINE_CAPTION = (
    "A: power over luminance, every reading, and the line. B: what the line misses; shaded is what is "
    "tolerated. C: readings of factors that were read in the warm-up or at the end too, over time. D: power "
    "that more luminance takes, from each level to the next; it rises where LEDs lose efficiency."
)


def luminance_report(result: LuminanceSweepFit, png: bytes, files: Mapping[str, str]) -> Report:
    """Return the report of a luminance sweep; `png` is its figure, `files` what else was written."""
    record, simulated = result.record, result.record.simulated
    warnings = tuple(_sentence(words) for words in (*display_warnings(record), *result.sweep.warnings))
    sections = [
        Section(
            "The display",
            (
                _how_measured(result.sweep.manifest),
                *_unless_warned(gamma_in_words(record), warnings),
                *(f"{_sentence(words)}." for words in against_file(result)),
            ),
            (_display_table(record),),
            (Picture(png, CURVE_CAPTION),),
            warnings,
            simulated,
        ),
        Section(
            "Pixel values",
            (),
            (_level_table("Pixel values at full brightness.", result.levels, "of the curve"),),
            simulated=simulated,
        ),
    ]
    if result.brightness:
        words = _unless_warned(brightness_in_words(record), warnings)
        table = _level_table("Brightness factors, white.", result.brightness, "in proportion to b")
        sections.append(Section("Brightness factors", words, (table,), simulated=simulated))
    sections += [provenance_section({"display model": record.provenance}), files_section(files)]
    lead = _sentence(display_lines(record)[0]) + "."
    return Report(f"Luminance of {record.display_name}", lead, tuple(sections), SIMULATED_SWEEP)


def power_report(result: PowerSweepFit, png: bytes, files: Mapping[str, str]) -> Report:
    """Return the report of a power sweep; `png` is its figure, `files` what else was written."""
    record = result.record
    warnings = tuple(_sentence(words) for words in (*power_warnings(record), *result.sweep.warnings))
    light = {
        LuminanceSource.METER: "Luminance was read by a meter right after each power reading.",
        LuminanceSource.FACTOR: "Nothing read the luminance: it is the brightness factor times the display's "
        "peak luminance, and the slope is as good as those.",
    }[record.luminance_source]
    sections = (
        Section(
            "The panel",
            (
                _how_measured(result.sweep.manifest),
                light,
                *_unless_warned(linearity_in_words(record), warnings),
            ),
            (_power_table(record),),
            (Picture(png, LINE_CAPTION),),
            warnings,
            record.simulated,
        ),
        Section("Brightness factors", (), (_power_level_table(result),), simulated=record.simulated),
        provenance_section({"power model": record.provenance}),
        files_section(files),
    )
    lead = _sentence(power_lines(record)[0]) + "."
    return Report(f"Power of {record.display_name}", lead, sections, SIMULATED_SWEEP)


def _how_measured(manifest: SweepManifest) -> str:
    """Return what was measured with what, and when."""
    rig, design = manifest.rig, manifest.design
    meters = {"luminance-sweep": f"the luminance meter {rig.luminance_meter}"}.get(
        manifest.task, f"the power meter {rig.power_meter} and the luminance meter {rig.luminance_meter}"
    )
    when = f", begun {manifest.started}" if manifest.started else ""
    return (
        f"Sweep {manifest.session_id} of the display {manifest.display_name} with {meters}{when}. Each level "
        f"was to be read {design.repeats} times, each time in another random order, after a warm-up of "
        f"{design.warm_up / 60:g} min."
    )


def _display_table(fit: DisplayFit) -> Table:
    """Return the display model with its intervals."""
    rows: list[tuple[Cell, ...]] = [
        ("γ", f"{fit.gamma:.4f}", interval_in_words(fit.gamma_interval, 5), "1"),
        (
            "peak L_max",
            f"{fit.peak_luminance:.5g}",
            interval_in_words(fit.peak_luminance_interval, 5),
            "cd/m²",
        ),
        ("black L_black", f"{fit.black_level:.3g}", interval_in_words(fit.black_level_interval, 3), "cd/m²"),
        ("reflected L_refl, as given", fit.reflected_luminance, None, "cd/m²"),
        ("noise of a reading, share", f"{100 * fit.noise_share:.2g}", None, "%"),
        ("noise of a reading in the dark", f"{fit.noise_floor:.2g}", None, "cd/m²"),
        ("lack of fit, F", fit.lack_of_fit_f, None, "1"),
        ("its probability on a gamma display", fit.lack_of_fit_p, None, "1"),
        *_change_rows("change at the end of the sweep", fit.drift, fit.drift_interval, "%"),
        *_change_rows("change late in the warm-up", fit.warm_up_change, fit.warm_up_interval, "% in 10 min"),
        ("readings, and without a value", f"{fit.n_readings} and {fit.n_under_range}", None, "1"),
    ]
    return Table(
        "The display model, with 95 % intervals.", ("quantity", "value", "interval", "unit"), tuple(rows)
    )


def _change_rows(
    name: str, share: float | None, interval: tuple[float, float] | None, unit: str
) -> list[tuple[Cell, ...]]:
    """Return the row of a change in percent; an empty one if it was not measured."""
    if share is None or interval is None:
        return [(name, None, None, unit)]
    low, high = (100 * end for end in interval)
    return [(name, f"{100 * share:.2f}", f"{low:.2f} to {high:.2f}", unit)]


def _level_table(caption: str, rows: tuple[LuminanceLevel, ...], model: str) -> Table:
    """Return measured levels beside a model."""
    cells = tuple(
        (
            row.pixel_value if row.factor is None else row.factor,
            row.achieved_factor,
            row.luminance,
            row.luminance_sd,
            row.n_readings,
            row.n_under_range,
            row.model_luminance,
            None if row.deviation is None else f"{100 * row.deviation:.2f}",
        )
        for row in rows
    )
    level = "L′" if rows and rows[0].factor is None else "b"
    measured = ("L [cd/m²]", "SD [cd/m²]", "n", "too dark")
    return Table(caption, (level, "achieved b", *measured, f"L {model} [cd/m²]", "deviation [%]"), cells)


def _power_table(fit: PowerFit) -> Table:
    """Return the power model with its intervals."""
    rows: list[tuple[Cell, ...]] = [
        ("base power", f"{fit.base_power:.5g}", interval_in_words(fit.base_power_interval), "W"),
        (
            "slope",
            f"{fit.power_per_luminance:.5g}",
            interval_in_words(fit.power_per_luminance_interval),
            "W m²/cd",
        ),
        ("luminance at b = 1", f"{fit.peak_luminance:.5g}", None, "cd/m²"),
        ("reflected L_refl, as given", fit.reflected_luminance, None, "cd/m²"),
        ("SD around the line", f"{1e3 * fit.residual_sd:.3g}", None, "mW"),
        ("R²", f"{fit.r_squared:.6f}", None, "1"),
        ("lack of fit, F", fit.lack_of_fit_f, None, "1"),
        ("its probability on a linear panel", fit.lack_of_fit_p, None, "1"),
        ("bend, of the added power", f"{100 * fit.bend:.2f}", None, "%"),
        ("its probability on a linear panel", fit.bend_p, None, "1"),
        *_change_rows("power at the end of the sweep", fit.drift, fit.drift_interval, "%"),
        *_change_rows("luminance then", fit.luminance_drift, fit.luminance_drift_interval, "%"),
        *_change_rows("change late in the warm-up", fit.warm_up_change, fit.warm_up_interval, "% in 10 min"),
        ("readings, and left out", f"{fit.n_readings} and {fit.n_left_out}", None, "1"),
        ("samples, lost, doubled", f"{fit.n_samples}, {fit.n_lost}, {fit.n_duplicated}", None, "1"),
    ]
    return Table(
        "The power model, with 95 % intervals.", ("quantity", "value", "interval", "unit"), tuple(rows)
    )


def _power_level_table(result: PowerSweepFit) -> Table:
    """Return measured levels beside the line."""
    rows = tuple(
        (
            row.factor, row.achieved_factor, row.luminance, row.luminance_sd, f"{row.power:.5g}",
            None if row.power_sd is None else f"{1e3 * row.power_sd:.3g}", row.n_readings,
            f"{1e3 * row.residual:.3g}",
        )
        for row in result.levels
    )  # fmt: skip
    columns = ("b", "achieved b", "L [cd/m²]", "SD [cd/m²]", "P [W]", "SD [mW]", "n", "P less line [mW]")
    return Table("Brightness factors, white.", columns, rows)


def _unless_warned(words: str, warnings: tuple[str, ...]) -> tuple[str, ...]:
    """Return a sentence, unless it is among the warnings."""
    sentence = _sentence(words)
    return () if sentence in warnings else (f"{sentence}.",)


def _sentence(words: str) -> str:
    """Return words of the terminal as a sentence of the report."""
    return words[0].upper() + words[1:].replace("^2", "²")
