"""The sections of the report, made from the records that they tell about."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from evenlight.analysis.figure_style import short
from evenlight.analysis.report import Cell, Picture, Section, Table
from evenlight.analysis.report_prose import section
from evenlight.analysis.tracks.gain_words import gain_sentences, uses_same_power
from evenlight.analysis.tracks.objective_words import less_or_more, little_of, minimized_in_words
from evenlight.analysis.wording import detection_in_words, first_few
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.roll_call import RollCall, SessionUse
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary
from evenlight.stimuli.video.viewing_geometry import geometry_words

CLAIM = (
    "What is made equal is the loss of visible contrast. Whether frames that lose the same share of it look "
    "equally good, only viewers can say: docs/validity.md tells what is known."
)


def introduction_section() -> Section:
    """Return what Evenlight does, in a paragraph for a newcomer."""
    return Section(
        "What was done",
        (
            "A dimmed display needs less power, but the eye sees less contrast in the dark: fine detail "
            "is lost, more of it in some scenes than in others. Evenlight dims a video over time so that "
            "a power budget is met, every frame loses about the same share of its visible contrast, and "
            "the brightness moves slowly enough to be hard to notice. For that it needs to know how fast "
            "a change is noticed on a display. Participants watch plain screens that darken "
            "slowly, and say whether they saw a change; from their answers follows the rate limit, the "
            "change that people who watch for it notice in 75 % of the trials. Within that limit an "
            "optimizer looks for the brightness of each frame.",
        ),
    )


def track_section(summary: OptimizationSummary, track_png: bytes, simulated: bool = False) -> Section:
    """Return what the optimizer made of a video.

    Parameters
    ----------
    summary : OptimizationSummary
        Its figures.
    track_png : bytes
        Its `track_figure`.
    simulated : bool
        Whether the rate limit rests on simulated participants.
    """
    caption = (
        "Brightness factor, contrast loss and rate of change over time, for the track (blue) and for "
        "constant dimming at the same power (orange). The rate, above 0 where the modulation brightens, "
        "must stay out of the red areas. Below: frames at the marked times, at full "
        "brightness and as they are shown."
    )
    notes: tuple[str, ...] = ()
    if summary.frames_without_contrast:
        notes = (
            f"{summary.frames_without_contrast} of {summary.frames} frames show nothing visible even at full "
            "brightness; they have nothing to lose, and count as a loss of 0.",
        )
    return Section(
        f"Brightness track of {summary.video}",
        (meaning_of(summary), CLAIM),
        (_summary_table(summary),),
        (Picture(track_png, caption),),
        notes,
        simulated,
    )


def meaning_of(summary: OptimizationSummary) -> str:
    """Return what the figures of a summary mean, in words."""
    ours, constant = summary.objective, summary.objective_baseline
    words = f"{' '.join(gain_sentences(summary))} "
    if not uses_same_power(summary):
        words += (
            f"The track needs {short(summary.mean_power)} W on average, constant dimming to "
            f"{100 * summary.baseline_factor:.0f} % takes {short(summary.baseline_power)} W. "
        )
    if summary.frames_without_contrast == summary.frames:
        words += "Nothing is visible in any frame, so there is no contrast to lose. "
    elif minimized := minimized_in_words(summary):
        words += (
            f"{minimized[0].upper()}{minimized[1:]}. Two frames picked at random differ by {short(ours)} in "
            f"the share of visible contrast that they lose, under constant dimming by {short(constant)}. "
        )
    elif constant > 0 and (little := little_of(summary)):
        words += f"There is {little}; two frames differ by {short(ours)} and {short(constant)}. "
    elif constant > 0:
        words += (
            "It spreads the lost contrast more evenly: two frames picked at random differ by "
            f"{short(ours)} in the share of visible contrast that they lose, "
            f"{less_or_more(1 - ours / constant)} than under constant dimming ({short(constant)}). No "
            f"track within the limits gets below {short(summary.lower_bound)}. "
        )
    else:
        words += "Constant dimming already loses the same share of contrast in every frame. "
    # By the limit without allowances: those are nothing that was calibrated.
    ratio = summary.max_rate_ratio if summary.max_rate_ratio_fitted is None else summary.max_rate_ratio_fitted
    kept = "stays within" if ratio <= 1 + 1e-6 else "goes beyond"
    return words + (
        f"The fastest change reaches {100 * ratio:.0f} % of the rate limit and {kept} "
        f"what the calibration allows. {detection_in_words(summary)}"
    )


def _summary_table(summary: OptimizationSummary) -> Table:
    """Return the figures of a summary with names and units."""
    unit = {
        BudgetUnit.FACTOR: "mean brightness factor",
        BudgetUnit.POWER: "share of full power",
        BudgetUnit.WATT: "W, mean power",
    }[summary.budget_unit]
    solver = f"time for the solver ({summary.solver}, {summary.iterations} iterations)"
    procedure = summary.rate_limit_procedure
    asked = "" if procedure is None else f" ({procedure.value.replace('_', ' ')})"
    seen = geometry_words(summary.field_of_view, summary.pixels_per_degree)
    return Table(
        f"{summary.video} on {summary.display}, seen {seen}, with the power model {summary.power_model} and "
        f"the rate limit {summary.rate_limit}{asked}.",
        ("quantity", "track", "constant dimming", "unit"),
        (
            ("budget asked", summary.budget, summary.budget, unit),
            ("budget used", summary.achieved, summary.budget, unit),
            ("mean brightness factor", summary.mean_factor, summary.baseline_factor, "1"),
            ("mean power", summary.mean_power, summary.baseline_power, "W"),
            ("power at full brightness", summary.full_power, summary.full_power, "W"),
            ("mean contrast loss", summary.mean_contrast_loss, summary.mean_contrast_loss_baseline, "1"),
            ("mean difference of contrast loss between two frames", summary.objective,
             summary.objective_baseline, "1"),
            ("lower bound of that difference", summary.lower_bound, None, "1"),
            ("fastest change, share of the rate limit", summary.max_rate_ratio, 0.0, "1"),
            ("share of the time at the rate limit", summary.share_at_limit, 0.0, "1"),
            ("share of the time above 0.9 of it", summary.share_near_limit, 0.0, "1"),
            ("reversals of the brightness", summary.reversals_per_s, 0.0, "1/s"),
            ("detectability of its changes, d′", summary.detectability, 0.0, "1"),
            ("length", summary.duration, summary.duration, "s"),
            ("frames", summary.frames, summary.frames, "1"),
            ("time for loss curves", summary.curves_s, None, "s"),
            (solver, summary.solve_s, None, "s"),
        ),
    )  # fmt: skip


def contrast_map_section(contrast_map_png: bytes, simulated: bool = False) -> Section:
    """Return where contrast is lost in one frame; the picture is its `contrast_map_figure`."""
    text = (
        "Dimming loses detail where contrast was just visible. The map shows one frame at the finest spatial "
        "frequency with visible contrast: white stays visible, red is lost."
    )
    caption = (
        "A frame, and its visible and lost contrast under the track's factor and under constant dimming."
    )
    return Section("Lost contrast", (text,), (), (Picture(contrast_map_png, caption),), (), simulated)


def roll_section(roll: RollCall) -> Section:
    """Return who took part: the sessions of a data set by task and status, and which cannot be read."""
    groups = dict.fromkeys((entry.task, entry.status) for entry in roll.sessions)
    rows: list[tuple[Cell, ...]] = []
    for task, status in groups:
        own = [entry for entry in roll.sessions if (entry.task, entry.status) == (task, status)]
        read = [entry for entry in own if entry.use is SessionUse.READ]
        rows.append((task, status or None, len(own), len(read), sum(entry.n_trials for entry in read)))
    columns = ("task", "status", "sessions", "can be read", "trials in them, practice and all")
    table = Table(f"Sessions of the data set {roll.dataset}.", columns, tuple(rows))
    present = {entry.participant_id for entry in roll.sessions if entry.session_id}
    usable = {entry.participant_id for entry in roll.read}
    sources = first_few(list(dict.fromkeys(entry.source for entry in roll.read if entry.source)))
    tables = (table, *_displays(roll))
    said = section("sessions", tables, roll=roll, present=len(present), usable=len(usable), sources=sources)
    return replace(said, notes=roll.warnings)


def _displays(roll: RollCall) -> tuple[Table, ...]:
    """Return a table of which sessions ran on which display and calibration; none if it was one."""
    own: dict[str, list[str]] = {}
    for entry in roll.read:
        own.setdefault(entry.display, []).append(f"{entry.participant_id}/{entry.session_id}")
    if len(own) < 2:
        return ()
    rows = tuple(
        (display.replace("^2", "²") or None, len(names), ", ".join(names)) for display, names in own.items()
    )
    return (Table("Displays and their calibrations.", ("display", "sessions", "participant/session"), rows),)


def provenance_section(origins: Mapping[str, Provenance]) -> Section:
    """Return software, seeds and inputs of some results.

    Parameters
    ----------
    origins : mapping of str to Provenance
        Where each result comes from, by its name.
    """
    software: list[tuple[Cell, ...]] = []
    inputs: list[tuple[Cell, ...]] = []
    for name, origin in origins.items():
        packages = ", ".join(f"{package} {version}" for package, version in origin.versions.items())
        software.append((name, origin.software_version, origin.software_revision, origin.seed, packages))
        inputs += [(name, what, digest) for what, digest in origin.inputs.items()]
    tables = (
        Table(
            "Software that made each result, and the seed of its random numbers.",
            ("result", "Evenlight", "revision", "seed", "packages"),
            tuple(software),
        ),
        Table(
            "What each result was made from, by its SHA-256.", ("result", "input", "SHA-256"), tuple(inputs)
        ),
    )
    return Section("Where it comes from", (), tables[: 2 if inputs else 1])


def files_section(files: Mapping[str, str]) -> Section:
    """Return the files that were written, by name, with what they hold."""
    return Section(
        "Files", (), (Table("Files beside this report.", ("file", "holds"), tuple(files.items())),)
    )
