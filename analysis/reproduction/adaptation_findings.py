"""Visual adaptation (Section 4.4): how far it lags where brightness changes within the rate limit, or not."""

from __future__ import annotations

from collections.abc import Sequence

from evenlight.analysis.figure_style import png_bytes
from evenlight.analysis.findings import Drawing, Findings
from evenlight.analysis.published import published, published_values
from evenlight.analysis.report import Section, Table
from evenlight.analysis.report_prose import prose, section
from evenlight.analysis.reproduction.adaptation_figures import (
    LuminanceChange,
    Results,
    changes,
    differences_figure,
    histogram_points,
    step_figure,
    step_points,
)
from evenlight.analysis.reproduction.adaptation_lag import (
    LARGE,
    AdaptationInput,
    ConeInput,
    DimmingCondition,
    ResponseDifferences,
    differences_of,
)
from evenlight.data_schema.analysis_results import Origin, Statistic
from evenlight.data_schema.errors import InputError

METHOD = "cones after Pattanaik et al. 2000; updated exactly, integrated within frames"
UNIT_UNKNOWN = "the paper prints no unit: not comparable in size"
PUBLISHED = {DimmingCondition.CONSTRAINED: "constrained", DimmingCondition.UNCONSTRAINED: "unconstrained"}
LARGEST_RESPONSE = 1.0  # so that no average of differences of responses can be larger
BEYOND = f"beyond what two responses from 0 to {LARGEST_RESPONSE:g} can differ by"


def adaptation_findings(sequences: Sequence[AdaptationInput]) -> Findings:
    """Return how far the cones' adaptation lags: constant dimming, and tracks with and without a rate limit.

    Parameters
    ----------
    sequences : sequence of AdaptationInput
        The sequences, and their tracks.

    Raises
    ------
    InputError
        If there is no sequence.
    """
    if not sequences:
        raise InputError("visual adaptation: expected at least one sequence with its tracks, got none")
    results = {
        (sequence.name, dimming, place): differences_of(sequence, dimming, place)
        for sequence in sequences
        for dimming in DimmingCondition
        for place in ConeInput
    }
    statistics = [
        *(row for sequence in sequences for row in _rows(sequence, results)),
        *_orderings(sequences, results),
    ]
    steps = changes()
    drawings = _drawings(sequences, results, steps)
    lead = _lead(sequences, results)
    return Findings(
        "adaptation",
        lead,
        tuple(statistics),
        drawings,
        (_section(sequences, results, lead, statistics, drawings),),
    )


def _rows(sequence: AdaptationInput, results: Results) -> list[Statistic]:
    """Return the statistics of a sequence."""
    rows: list[Statistic] = []
    for place in ConeInput:
        for dimming in DimmingCondition:
            rows += _difference_rows(sequence, results[sequence.name, dimming, place], dimming, place)
        rows += [
            _excess(sequence, results, dimming, place)
            for dimming in (DimmingCondition.CONSTRAINED, DimmingCondition.UNCONSTRAINED)
        ]
    rows.append(_coarser(sequence, results))
    for dimming, column in PUBLISHED.items():
        rows += [
            Statistic(
                "adaptation", sequence.name, f"average difference, {dimming.value}", value.number, value.unit,
                Origin.PUBLISHED, method=value.place, flag=_flag_of(value.number),
            )
            for value in published_values(f"adaptation.{sequence.name}.{column}")
        ]  # fmt: skip
    return rows


def _flag_of(printed: float) -> str:
    """Return what keeps a printed number from being compared.

    >>> _flag_of(0.4189), _flag_of(1.4984)[-35:]
    ('the paper prints no unit: not comparable in size', 'responses from 0 to 1 can differ by')
    """
    return f"{UNIT_UNKNOWN}; {BEYOND}" if printed > LARGEST_RESPONSE else UNIT_UNKNOWN


def _difference_rows(
    sequence: AdaptationInput, found: ResponseDifferences, dimming: DimmingCondition, place: ConeInput
) -> list[Statistic]:
    """Return the numbers of one way to dim."""
    where = f"{place.value}, {dimming.value}"
    numbers = (
        ("integral of |static - dynamic response| over time", found.integral, "s"),
        ("mean of |static - dynamic response| over time", found.mean, "1"),
        ("root mean square of the difference", found.root_mean_square, "1"),
        ("largest difference", found.largest, "1"),
        (f"share of the time with a difference above {LARGE:g}", found.large, "1"),
    )
    method = f"{METHOD}; n frames, {found.n_pixels} places"
    return [
        Statistic("adaptation", sequence.name, f"{what}: {where}", value, unit, Origin.COMPUTED,
                  n=found.n_frames, method=method)
        for what, value, unit in numbers
    ]  # fmt: skip


def _excess(
    sequence: AdaptationInput, results: Results, dimming: DimmingCondition, place: ConeInput
) -> Statistic:
    """Return the mean difference beyond that of constant dimming, as a share of it."""
    constant = results[sequence.name, DimmingCondition.CONSTANT, place].mean
    own = results[sequence.name, dimming, place]
    still = "nothing changes under constant dimming: there is no ratio" if constant == 0 else ""
    return Statistic(
        "adaptation", sequence.name, f"excess over constant dimming: {place.value}, {dimming.value}",
        own.mean / constant - 1 if constant > 0 else None, "1", Origin.COMPUTED, n=own.n_frames,
        method="mean difference, relative to that of constant dimming of the same mean factor", flag=still,
    )  # fmt: skip


def _coarser(sequence: AdaptationInput, results: Results) -> Statistic:
    """Return what maps of half the width would give: fine detail is lost in blocks."""
    fine = results[sequence.name, DimmingCondition.CONSTRAINED, ConeInput.PIXEL]
    coarse = differences_of(sequence, DimmingCondition.CONSTRAINED, ConeInput.PIXEL, coarser=2)
    still = "nothing changes: there is no ratio" if fine.mean == 0 else ""
    return Statistic(
        "adaptation", sequence.name, "mean difference in maps of half the width, relative to these",
        coarse.mean / fine.mean if fine.mean > 0 else None, "1", Origin.COMPUTED, n=fine.n_frames,
        method=f"{coarse.n_pixels} instead of {fine.n_pixels} blocks, {DimmingCondition.CONSTRAINED.value}",
        flag=still,
    )  # fmt: skip


def _orderings(sequences: Sequence[AdaptationInput], results: Results) -> tuple[Statistic, ...]:
    """Return in how many sequences the difference is larger without a rate limit: what can be compared."""
    rows = []
    for place in ConeInput:
        larger = sum(
            results[s.name, DimmingCondition.UNCONSTRAINED, place].mean
            > results[s.name, DimmingCondition.CONSTRAINED, place].mean
            for s in sequences
        )
        rows.append(
            Statistic(
                "ordering", "all", f"sequences with a larger difference without a rate limit: {place.value}",
                larger, "1", Origin.COMPUTED, n=len(sequences), method="n sequences",
            )
        )  # fmt: skip
    named = [s.name for s in sequences if published_values(f"adaptation.{s.name}")]
    theirs = [
        tuple(published(f"adaptation.{name}.{column}").number for column in PUBLISHED.values())
        for name in named
    ]
    if theirs:
        rows.append(
            Statistic(
                "ordering", "all", "sequences with a larger difference without a rate limit",
                sum(free > limited for limited, free in theirs), "1", Origin.PUBLISHED, n=len(theirs),
                method="n sequences",
            )
        )  # fmt: skip
    return tuple(rows)


def _drawings(
    sequences: Sequence[AdaptationInput], results: Results, steps: tuple[LuminanceChange, LuminanceChange]
) -> tuple[Drawing, Drawing]:
    """Return the figures."""
    return (
        Drawing(
            "adaptation_histogram",
            png_bytes(differences_figure(sequences, results)),
            "Histogram of the differences between static and dynamic response, as shares of time (and, on "
            "the left, of blocks of pixels): constant dimming, the track within the rate limit, the track "
            "without. The further right, the more adaptation lags. Five bars to a factor of ten; the first "
            "holds all that is smaller, too. Triangles and numbers are means.",
            histogram_points(sequences, results),
        ),
        Drawing(
            "adaptation_step",
            png_bytes(step_figure(steps)),
            f"Static and dynamic response to a halving of brightness, {' and '.join(s.name for s in steps)}. "
            "The shaded areas are the integrals of the difference over time: "
            f"{' and '.join(f'{1000 * s.integral:.1f} ms' for s in steps)}, with differences of up to "
            f"{' and '.join(f'{s.largest:.1g}' for s in steps)}.",
            step_points(steps),
        ),
    )


def _lead(sequences: Sequence[AdaptationInput], results: Results) -> str:
    """Return what came out."""

    def excess(dimming: DimmingCondition, place: ConeInput) -> str:
        own, constant = (
            sum(results[s.name, each, place].integral for s in sequences)
            for each in (dimming, DimmingCondition.CONSTANT)
        )
        return f"{100 * (own / constant - 1):+.0f} %" if constant > 0 else "no ratio"

    larger = sum(
        results[s.name, DimmingCondition.UNCONSTRAINED, ConeInput.PIXEL].integral
        > results[s.name, DimmingCondition.CONSTRAINED, ConeInput.PIXEL].integral
        for s in sequences
    )
    (lead,) = prose(
        "reproduction/adaptation_lead",
        larger=larger,
        count=len(sequences),
        excess=excess,
        dimming=DimmingCondition,
        input=ConeInput,
    )
    return lead


def _section(
    sequences: Sequence[AdaptationInput],
    results: Results,
    lead: str,
    statistics: Sequence[Statistic],
    drawings: tuple[Drawing, Drawing],
) -> Section:
    """Return the section of the report: what came out, and the paper's table beside it."""
    durations = [duration for sequence in sequences for duration in sequence.maps.durations]
    printed = [
        value
        for sequence in sequences
        for column in PUBLISHED.values()
        for value in published_values(f"adaptation.{sequence.name}.{column}")
    ]
    return section(
        "reproduction/adaptation",
        _tables(sequences, results),
        [drawing.picture for drawing in drawings],
        lead=lead,
        beyond=[value.text for value in printed if value.number > LARGEST_RESPONSE],
        why_beyond=BEYOND,
        frames=len(durations),
        held_ms=1000 * sum(durations) / len(durations),
        coarser=[
            s.value
            for s in statistics
            if s.what.startswith("mean difference in maps") and s.value is not None
        ],
    )


def _tables(sequences: Sequence[AdaptationInput], results: Results) -> tuple[Table, ...]:
    """Return the paper's table, its numbers beside ours, and one of what else differs."""
    ways = tuple(dimming.value for dimming in DimmingCondition)
    integrals, spreads = [], []
    for sequence in sequences:
        printed = {
            value.name.rpartition(".")[2]: value.text
            for value in published_values(f"adaptation.{sequence.name}")
        }
        name = sequence.name.replace("_", " ")
        for place in ConeInput:
            found = [results[sequence.name, dimming, place] for dimming in DimmingCondition]
            theirs = (
                (printed.get(column) for column in PUBLISHED.values())
                if place is ConeInput.PIXEL
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
