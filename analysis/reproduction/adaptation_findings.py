"""Visual adaptation (Section 4.4): what it says of brightness that changes within the rate limit, or not."""

from __future__ import annotations

from collections.abc import Sequence

from evenlight.analysis.figure_style import png_bytes
from evenlight.analysis.findings import Drawing, Findings
from evenlight.analysis.published import published, published_values
from evenlight.analysis.reproduction.adaptation_differences import (
    LARGE,
    AdaptationInput,
    Differences,
    Dimming,
    Place,
    differences_of,
)
from evenlight.analysis.reproduction.adaptation_figure import Results, differences_figure
from evenlight.analysis.reproduction.adaptation_points import histogram_points, step_points
from evenlight.analysis.reproduction.adaptation_section import (
    BEYOND,
    LARGEST_RESPONSE,
    PUBLISHED,
    adaptation_section,
)
from evenlight.analysis.reproduction.adaptation_step_figure import Change, changes, step_figure
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.statistic import Origin, Statistic

METHOD = "cones after Pattanaik et al. 2000; updated exactly, integrated within frames"
UNIT_UNKNOWN = "the paper prints no unit: not comparable in size"


def adaptation_findings(sequences: Sequence[AdaptationInput], origin: Origin = Origin.COMPUTED) -> Findings:
    """Return how far the cones' adaptation lags: constant dimming, and tracks with and without a rate limit.

    Parameters
    ----------
    sequences : sequence of AdaptationInput
        The sequences, and their tracks.
    origin : Origin
        Where the tracks come from; without people, computed.

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
        for dimming in Dimming
        for place in Place
    }
    statistics = [
        *(row for sequence in sequences for row in _rows(sequence, results, origin)),
        *_orderings(sequences, results, origin),
    ]
    steps = changes()
    drawings = _drawings(sequences, results, steps, origin)
    lead = _lead(sequences, results)
    return Findings(
        "adaptation",
        lead,
        tuple(statistics),
        drawings,
        (adaptation_section(sequences, results, lead, statistics, drawings),),
    )


def _rows(sequence: AdaptationInput, results: Results, origin: Origin) -> list[Statistic]:
    """Return the statistics of a sequence."""
    rows: list[Statistic] = []
    for place in Place:
        for dimming in Dimming:
            rows += _difference_rows(sequence, results[sequence.name, dimming, place], dimming, place, origin)
        rows += [
            _excess(sequence, results, dimming, place, origin)
            for dimming in (Dimming.CONSTRAINED, Dimming.UNCONSTRAINED)
        ]
    rows.append(_coarser(sequence, results, origin))
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
    sequence: AdaptationInput, found: Differences, dimming: Dimming, place: Place, origin: Origin
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
        Statistic("adaptation", sequence.name, f"{what}: {where}", value, unit, origin,
                  n=found.n_frames, method=method)
        for what, value, unit in numbers
    ]  # fmt: skip


def _excess(
    sequence: AdaptationInput, results: Results, dimming: Dimming, place: Place, origin: Origin
) -> Statistic:
    """Return the mean difference beyond that of constant dimming, as a share of it."""
    constant = results[sequence.name, Dimming.CONSTANT, place].mean
    own = results[sequence.name, dimming, place]
    still = "nothing changes under constant dimming: there is no ratio" if constant == 0 else ""
    return Statistic(
        "adaptation", sequence.name, f"excess over constant dimming: {place.value}, {dimming.value}",
        own.mean / constant - 1 if constant > 0 else None, "1", origin, n=own.n_frames,
        method="mean difference, relative to that of constant dimming of the same mean factor", flag=still,
    )  # fmt: skip


def _coarser(sequence: AdaptationInput, results: Results, origin: Origin) -> Statistic:
    """Return what maps of half the width would give: fine detail is lost in blocks."""
    fine = results[sequence.name, Dimming.CONSTRAINED, Place.PIXEL]
    coarse = differences_of(sequence, Dimming.CONSTRAINED, Place.PIXEL, coarser=2)
    still = "nothing changes: there is no ratio" if fine.mean == 0 else ""
    return Statistic(
        "adaptation", sequence.name, "mean difference in maps of half the width, relative to these",
        coarse.mean / fine.mean if fine.mean > 0 else None, "1", origin, n=fine.n_frames,
        method=f"{coarse.n_pixels} instead of {fine.n_pixels} blocks, {Dimming.CONSTRAINED.value}",
        flag=still,
    )  # fmt: skip


def _orderings(
    sequences: Sequence[AdaptationInput], results: Results, origin: Origin
) -> tuple[Statistic, ...]:
    """Return in how many sequences the difference is larger without a rate limit: what can be compared."""
    rows = []
    for place in Place:
        larger = sum(
            results[s.name, Dimming.UNCONSTRAINED, place].mean
            > results[s.name, Dimming.CONSTRAINED, place].mean
            for s in sequences
        )
        rows.append(
            Statistic(
                "ordering", "all", f"sequences with a larger difference without a rate limit: {place.value}",
                larger, "1", origin, n=len(sequences), method="n sequences",
            )
        )  # fmt: skip
    named = [s.name for s in sequences if published_values(f"adaptation.{s.name}")]
    theirs = [tuple(_published(name, column) for column in PUBLISHED.values()) for name in named]
    if theirs:
        rows.append(
            Statistic(
                "ordering", "all", "sequences with a larger difference without a rate limit",
                sum(free > limited for limited, free in theirs), "1", Origin.PUBLISHED, n=len(theirs),
                method="n sequences",
            )
        )  # fmt: skip
    return tuple(rows)


def _published(name: str, column: str) -> float:
    """Return a number of the paper's table."""
    return published(f"adaptation.{name}.{column}").number


def _drawings(
    sequences: Sequence[AdaptationInput], results: Results, steps: tuple[Change, Change], origin: Origin
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
            histogram_points(sequences, results, origin),
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

    def total(dimming: Dimming, place: Place) -> float:
        return sum(results[s.name, dimming, place].integral for s in sequences)

    def excess(dimming: Dimming, place: Place) -> str:
        constant = total(Dimming.CONSTANT, place)
        return f"{100 * (total(dimming, place) / constant - 1):+.0f} %" if constant > 0 else "no ratio"

    words = [
        f"{excess(Dimming.CONSTRAINED, place)} within the rate limit and "
        f"{excess(Dimming.UNCONSTRAINED, place)} without one, {name}"
        for place, name in ((Place.PIXEL, "per pixel"), (Place.FRAME_MEAN, "on the frame mean"))
    ]
    larger = sum(
        results[s.name, Dimming.UNCONSTRAINED, Place.PIXEL].integral
        > results[s.name, Dimming.CONSTRAINED, Place.PIXEL].integral
        for s in sequences
    )
    return (
        f"The cones' response lags further behind without a rate limit than within it in {larger} of "
        f"{len(sequences)} sequences, per pixel. Against constant dimming, summed over the sequences: "
        f"{'; '.join(words)}."
    )
