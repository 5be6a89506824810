"""The numbers that the figure of detail ratings draws."""

from __future__ import annotations

from collections.abc import Iterator

from evenlight.analysis.rating.rating_figure import bin_width, difference_counts
from evenlight.analysis.rating.rating_results import PairResult, RatingResults
from evenlight.analysis.rating.rating_rows import POINTS
from evenlight.analysis.rating.rating_statistics import mean_of
from evenlight.data_schema.statistic import Origin, PlottedPoint
from evenlight.data_schema.viewing import HIGHEST_RATING, LOWEST_RATING


def rating_points(results: RatingResults) -> tuple[PlottedPoint, ...]:
    """Return every number that `rating_figure` draws: bars and means of ratings, and of differences."""
    origin = Origin.SIMULATED if results.simulated else Origin.RECORDED
    differences = [point for result in results.shown for point in _difference_points(result, origin)]
    return (*_rating_points(results, origin), *differences)


def _rating_points(results: RatingResults, origin: Origin) -> Iterator[PlottedPoint]:
    """Return how often each rating was given, and the means."""
    for (sequence, version), ratings in results.versions.items():
        n, mean = len(ratings.means), mean_of(ratings)
        for rating in range(LOWEST_RATING, HIGHEST_RATING + 1):
            yield PlottedPoint(
                panel=sequence,
                series=f"{version.value}, ratings",
                label="",
                x=float(ratings.ratings.count(rating)),
                y=float(rating),
                x_quantity="number of ratings",
                x_unit="1",
                y_quantity="rating",
                y_unit=POINTS,
                origin=origin,
                n=len(ratings.ratings),
            )
        yield PlottedPoint(
            panel=sequence,
            series=f"{version.value}, mean and 95 % interval",
            label=version.value,
            x=None,
            y=mean.value,
            x_quantity="version",
            x_unit="1",
            y_quantity="mean rating",
            y_unit=POINTS,
            origin=origin,
            low=mean.ci_low,
            high=mean.ci_high,
            n=n,
        )


def _difference_points(result: PairResult, origin: Origin) -> Iterator[PlottedPoint]:
    """Return how many participants have each difference, and the mean."""
    name, n = result.pairs.name, len(result.pairs.participant_ids)
    for difference, count in difference_counts(result.pairs).items():
        yield PlottedPoint(
            panel="differences",
            series=f"{name}, bins of {bin_width(result.pairs):g}",
            label="",
            x=difference,
            y=float(count),
            x_quantity="ours less baseline",
            x_unit=POINTS,
            y_quantity="number of participants",
            y_unit="1",
            origin=origin,
            n=n,
        )
    yield PlottedPoint(
        panel="differences",
        series="mean and 95 % interval",
        label=name,
        x=None,
        y=result.mean.value,
        x_quantity="sequence",
        x_unit="1",
        y_quantity="mean of ours less baseline",
        y_unit=POINTS,
        origin=origin,
        low=result.mean.ci_low,
        high=result.mean.ci_high,
        n=n,
    )
