"""The section of the report on visual adaptation: what came out, and the paper's table beside it."""

from __future__ import annotations

from collections.abc import Sequence

from evenlight.analysis.findings import Drawing
from evenlight.analysis.published import published_values
from evenlight.analysis.report import Section, Table
from evenlight.analysis.reproduction.adaptation_differences import AdaptationInput, Dimming, Place
from evenlight.analysis.reproduction.adaptation_figure import Results
from evenlight.data_schema.statistic import Statistic

PUBLISHED = {Dimming.CONSTRAINED: "constrained", Dimming.UNCONSTRAINED: "unconstrained"}
LARGEST_RESPONSE = 1.0  # so that no average of differences of responses can be larger
BEYOND = f"beyond what two responses from 0 to {LARGEST_RESPONSE:g} can differ by"


def adaptation_section(
    sequences: Sequence[AdaptationInput],
    results: Results,
    lead: str,
    statistics: Sequence[Statistic],
    drawings: tuple[Drawing, Drawing],
) -> Section:
    """Return the section of the report.

    Parameters
    ----------
    sequences : sequence of AdaptationInput
        The sequences, and their tracks.
    results : dict
        Their differences.
    lead : str
        What came out.
    statistics : sequence of Statistic
        The rows behind it.
    drawings : tuple of Drawing
        The figures.
    """
    coarser = [
        s.value for s in statistics if s.what.startswith("mean difference in maps") and s.value is not None
    ]
    width = f"{min(coarser):.2f} to {max(coarser):.2f}" if coarser else "no"
    return Section(
        "Visual adaptation",
        (
            lead,
            "The static response is that of cones that have adapted to what they see, the dynamic one that "
            "of cones whose neural adaptation follows with 80 ms and whose pigment with 110 s (which at the "
            "luminances of a display changes the response by less than one in ten thousand). Their "
            "difference says how far adaptation lags. The picture moves too, so that constant dimming is "
            "the reference: what exceeds it is the modulation's.",
            f"The paper prints no unit{_beyond_in_words(sequences)}; what can be compared is the order. The "
            "integral over time does not tell fast from slow: a change of brightness costs nearly the same "
            "integral however long it takes (second figure), so that a larger one means more to and fro, "
            "not faster changes. The root mean square weighs fast ones more; the largest is mostly "
            "that of the content's own cuts.",
            f"Computed, not sampled: there is no interval. {_frames_in_words(sequences)} "
            f"Blocks of pixels smooth detail that moves: maps "
            f"of half the width have {width} of the mean difference per pixel, so its size, unlike the "
            "comparison, holds for this width alone. Rods are left out, as in the paper; gaze that follows "
            "or wanders lies between the two columns.",
        ),
        _tables(sequences, results),
        tuple(drawing.picture for drawing in drawings),
    )


def _frames_in_words(sequences: Sequence[AdaptationInput]) -> str:
    """Return how many frames there are, how long each is held, and that the result does not rest on it."""
    count = sum(len(sequence.maps.durations) for sequence in sequences)
    held = 1000 * sum(sum(sequence.maps.durations) for sequence in sequences) / count
    return (
        f"{count} frames, each held for {held:.0f} ms on average; within them the responses follow exactly, "
        "so that no step of time is taken."
    )


def _beyond_in_words(sequences: Sequence[AdaptationInput]) -> str:
    """Return which printed numbers cannot be average differences of responses."""
    beyond = [
        value.text
        for sequence in sequences
        for column in PUBLISHED.values()
        for value in published_values(f"adaptation.{sequence.name}.{column}")
        if value.number > LARGEST_RESPONSE
    ]
    return f", and {' and '.join(beyond)} is {BEYOND}" if beyond else ""


def _tables(sequences: Sequence[AdaptationInput], results: Results) -> tuple[Table, ...]:
    """Return the paper's table, its numbers beside ours, and one of what else differs."""
    ways = tuple(dimming.value for dimming in Dimming)
    integrals, spreads = [], []
    for sequence in sequences:
        printed = {
            value.name.rpartition(".")[2]: value.text
            for value in published_values(f"adaptation.{sequence.name}")
        }
        name = sequence.name.replace("_", " ")
        for place in Place:
            found = [results[sequence.name, dimming, place] for dimming in Dimming]
            theirs = (
                (printed.get(column) for column in PUBLISHED.values())
                if place is Place.PIXEL
                else (None, None)
            )
            integrals.append((name, place.value, *(1000 * each.integral for each in found), *theirs))
            spreads.append(
                (
                    name,
                    place.value,
                    *(1000 * each.mean for each in found),
                    *(1000 * each.root_mean_square for each in found),
                )
            )
    return (
        Table(
            "Difference of static and dynamic cone response, integrated over time [ms], and the paper's "
            "numbers (constrained, unconstrained; without a unit).",
            ("sequence", "cones", *ways, "published: constr.", "unconstr."),
            tuple(integrals),
        ),
        Table(
            "Average over time and root mean square of the same difference, x 1000 [1].",
            ("sequence", "cones", *(f"average, {way}" for way in ways), *(f"RMS, {way}" for way in ways)),
            tuple(spreads),
        ),
    )
