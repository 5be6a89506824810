"""The report of a reproduction: every table and figure, with where each number comes from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from evenlight.analysis.findings import Findings
from evenlight.analysis.report import Report, Section, Table
from evenlight.analysis.report_sections import files_section, provenance_section
from evenlight.analysis.reproduction.reproduction import PIPELINE, Reproduction
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.statistic import Origin

TITLE = "Temporal brightness management: the paper's tables and figures, made anew"
SIMULATED = (
    "Simulated participants answer wherever no recorded data were given. They follow models of seeing and "
    "judging whose figures are choices (docs/decisions/simulated-viewers.md): that they prefer one "
    "version, or do not, is no evidence that people do."
)
MEANINGS = {
    Origin.PUBLISHED: "printed in the paper, or from the program that its authors published",
    Origin.SIMULATED: "from answers of simulated participants: show how the analysis works",
    Origin.RECORDED: "from answers of people, or from readings of instruments",
    Origin.COMPUTED: "by the model, from rendered sequences: nobody was asked",
}
# What rests on no answer but on the rate limit alone; the rest says itself where it comes from.
COMPUTED = ("thresholded_contrast", "examples", "sequences", "adaptation", "power", "online")
ON_LIMIT = ("examples", "sequences", "adaptation", "power", "online")
WHY_NOT = (
    "In the paper people rated ours higher. Whether simulated raters do follows from how they are "
    "built and from what our own scenes lose in their worst moments, and from nothing else."
)
LED_BY = ("rating", "search", "comparison", "adaptation", "online")  # whose findings the first page tells


def reproduction_report(made: Reproduction, parts: Sequence[Findings], origin: Provenance) -> Report:
    """Return the report.

    Parameters
    ----------
    made : Reproduction
        What the pipeline made.
    parts : sequence of Findings
        Its parts, in the order of the paper.
    origin : Provenance
        Software, seed and inputs.
    """
    first, *others = parts
    return Report(
        TITLE,
        _lead(parts),
        (
            *first.sections,
            _what_came_out(made, parts),
            _how_to_read(made),
            *(section for part in others for section in _sections(made, part)),
            provenance_section({"reproduction": origin}),
            files_section(_files(parts)),
        ),
        SIMULATED,
    )


def _lead(parts: Sequence[Findings]) -> str:
    """Return what came out of the method itself; what participants say follows with its origin."""
    named = {part.name: part for part in parts}
    return f"{named['sequences'].lead} {named['power'].lead}"


def _what_came_out(made: Reproduction, parts: Sequence[Findings]) -> Section:
    """Return the findings of each experiment, in words."""
    named = {part.name: part for part in parts}
    simulated = made.tasks.simulated
    return Section(
        "What came out",
        (*(named[name].lead for name in LED_BY), *((WHY_NOT,) if simulated["rating"] else ())),
        simulated=any(simulated[name] for name in LED_BY if name in simulated),
    )


def _sections(made: Reproduction, part: Findings) -> Iterator[Section]:
    """Yield the sections of a part with their origin: the first with its heading, the others below it."""
    limit = made.panel.rate_limit
    for place, section in enumerate(part.sections):
        mark, notes = section.mark, section.notes
        if part.name in COMPUTED:
            mark = Origin.COMPUTED.value
            if place == 0 and part.name in ON_LIMIT and limit.simulated:
                notes = (*notes, "The rate limit of these tracks rests on simulated participants.")
        yield replace(
            section,
            below=place > 0 and part.name != "examples",
            mark=mark,
            notes=notes,
            simulated=section.simulated and part.name not in COMPUTED,
        )


def _how_to_read(made: Reproduction) -> Section:
    """Return what the origins mean, and what was done."""
    plan, display = made.plan, made.panel.display
    width, height = plan.size
    counts = ", ".join(
        f"{n} {'simulated' if made.tasks.simulated[task] else 'recorded'} participants for {task}"
        for task, n in made.tasks.participants.items()
    )
    done = (
        f"The sequences are rendered anew from two scenes of our own, in {width} x {height} pixels at "
        f"{plan.frames_per_second:g} frames per second, and shown pixel for pixel on the display "
        f"{display.name!r} ({display.peak_luminance:g} cd/m², {display.pixels_per_degree:g} pixels per "
        f"degree). The authors' scenes are not public, so numbers that depend on content differ. {counts}."
    )
    rows = tuple((kind.value, words) for kind, words in MEANINGS.items())
    return Section(
        "How to read this",
        (
            done,
            "Every number has one of four origins; the heading of a section says which, or a column of its "
            "table does. The tables below and those in tables/ hold the same numbers; behind each figure "
            "lies a table of its points.",
        ),
        (Table("Where a number comes from.", ("origin", "means"), rows),),
    )


def _files(parts: Sequence[Findings]) -> dict[str, str]:
    """Return the files beside the report, with what they hold."""
    files = {
        f"tables/{part.name}_statistics.csv": f"every number of the part {part.name.replace('_', ' ')}"
        for part in parts
        if part.statistics
    }
    for part in parts:
        for drawing in part.drawings:
            files[f"figures/{drawing.name}.png, {drawing.name}_points.csv"] = drawing.caption
    files[f"{PIPELINE}/"] = "data sets, calibration, tracks and loss curves that all of it is made of"
    files[f"{PIPELINE}.sha256"] = "what a later run knows that folder by; only such a folder is replaced"
    files["reproduction.json"] = "software, seed, inputs, warnings, files"
    return files
