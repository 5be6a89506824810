"""What the detail ratings show (the paper's Section 4.1): first lines, a figure, and four sections."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np

from evenlight.analysis.inference.paired_effects import Effect, mean_difference, within
from evenlight.analysis.integrity.gate import confounded_order
from evenlight.analysis.rating import rating_pairs as pairs
from evenlight.analysis.rating.rating_figure import bins_of, rating_figure
from evenlight.analysis.rating.rating_model import model_ratings
from evenlight.analysis.rating.rating_order import PLACE, describe_order
from evenlight.analysis.rating.rating_pairs import ALL, MEAN, POINTS, Ratings, Sample, different_sequences
from evenlight.analysis.rating.rating_power import fewest_pairs
from evenlight.analysis.report import Cell, KeyFigure, Section, Table
from evenlight.analysis.report_prose import prose, section
from evenlight.analysis.results import Analysis
from evenlight.analysis.rows import count, how_sure, number, significant, with_interval
from evenlight.analysis.session_loading import TaskData
from evenlight.analysis.wording import in_words, listed, of_track, p_in_words, people_noun, spaced
from evenlight.data_schema.analysis_results import Statistic
from evenlight.data_schema.recordings.rating_scale import ONE_TO_FIVE, RatingScale
from evenlight.data_schema.recordings.viewing import RatingTrial, Version

MOST_COUNTS = 7  # columns of the versions' table for single ratings; quartiles stand for more
QUARTILES = {"lower quartile": 25, "median": 50, "upper quartile": 75}
ERRORS = ("standard error", "standard error, population SD")


def rating_findings(data: TaskData[RatingTrial], seed: int = 1) -> Analysis:
    """Analyse the ratings of a data set.

    Parameters
    ----------
    data : TaskData of RatingTrial
        All sessions of the task.
    seed : int
        Of the permutations, and of the experiments that are drawn for the smallest difference.
    """
    ratings, rng = pairs.ratings_of(data), np.random.default_rng(seed)
    described, compared = describe_versions(ratings), pairs.compare_versions(ratings, seed)
    modelled, order = model_ratings(ratings, rng), describe_order(ratings, rng)
    drawing = rating_figure(ratings)
    first = replace(described, pictures=(drawing.picture,))
    return Analysis(
        name="rating",
        lead=_lead(ratings),
        rows=tuple(ratings.rows),
        drawings=(drawing,),
        sections=tuple(replace(own, simulated=data.simulated) for own in (first, compared, modelled, order)),
        warnings=(*data.warnings, *_warnings(ratings)),
        key_figures=_key_figures(ratings),
    )


def _lead(ratings: Ratings) -> str:
    different, scale = different_sequences(ratings), ratings.data.scale
    return prose(
        "rating_lead",
        mean=ratings.rows.find("differences", next(reversed(ratings.shown)), MEAN),
        people=ratings.people,
        simulated=ratings.data.simulated,
        rated=len(ratings.rated),
        scale="" if scale == ONE_TO_FIVE else f"{scale.lowest:g} to {scale.highest:g}",
        different=None if different is None else len(different),
        confound=confounded_order(ratings.data),
        order_unknown=all(trial.place_in_pair is None for trial in ratings.data.trials),
    )[0]


def _key_figures(ratings: Ratings) -> tuple[KeyFigure, ...]:
    find, overall, n = ratings.rows.find, next(reversed(ratings.shown)), ratings.n_people
    figures = []
    if mean := _sure(find("differences", overall, MEAN)):
        figures.append(KeyFigure(mean[0], "the track less constant dimming", mean[1]))
    different, enough = different_sequences(ratings), n >= fewest_pairs()
    if different is not None and len(ratings.rated) > 1 and enough:
        words = f"{len(different)} of {len(ratings.rated)}"
        figures.append(KeyFigure(words, "sequences differ beyond chance", "exact tests, Holm"))
    smallest = find("sensitivity", overall, pairs.SMALLEST)
    known = smallest is not None and smallest.value is not None
    lack = f"{len(ratings.incomplete)} lack a version"
    found = f"usually find {significant(smallest)[0]} points or more" if known else ""
    who, lacking = people_noun(n, ratings.data.simulated), bool(ratings.incomplete)
    figures.append(KeyFigure(f"{n}", who, lack if lacking else found, warns=lacking))
    if confound := confounded_order(ratings.data):
        figures.append(KeyFigure(confound, "order and version cannot be told apart", warns=True))
    elif place := _sure(find("order", ALL, PLACE)):
        figures.append(KeyFigure(place[0], "for being shown second", place[1]))
    return tuple(figures)


def _sure(row: Statistic | None) -> tuple[str, str] | None:
    """Return a number of points and how sure it is; fewer than six people bound nothing."""
    if row is None or row.value is None or row.p_value is None or row.n is None:
        return None
    few = row.n < fewest_pairs()
    return f"{row.value:+z.2f} points", p_in_words(row.p_value) if few else how_sure(row)


def _warnings(ratings: Ratings) -> list[str]:
    """Return what is wrong with the ratings but does not forbid their use."""
    found = ratings.rows.separated()
    if ratings.n_people == 1:
        found.append("ratings of one participant: nothing can be tested, nothing is said of other people")
    if ratings.unrated:
        names = listed([spaced(name) for name in ratings.unrated])
        found.append(f"nobody rated {names}: Holm's adjustment counts the other sequences only")
    if ratings.incomplete:
        found.append(f"participants without both versions of every sequence: {', '.join(ratings.incomplete)}")
    return found


def describe_versions(ratings: Ratings) -> Section:
    """Add mean, spread, median and distribution of each version; return the paper's table."""
    rows, scale = ratings.rows, ratings.data.scale
    bins = bins_of(scale)
    for (name, version), sample in ratings.means.items():
        n, values, of = len(sample.of), sample.values, f", {version.value}"
        given = ratings.given(name, version)
        add = partial(rows.add, "means", name)
        method = f"mean over participants; interval: {pairs.ADJUSTED_T}"
        add(f"mean rating{of}", POINTS, method, _mean_rating(sample, scale), n)
        if n:
            _add_spread(add, sample, of)
            add(f"median rating{of}", POINTS, "over participants", float(np.median(values)), n)
        for k, number_of in zip(bins.names, np.histogram(given, bins.ends)[0], strict=True):
            what = f"ratings of {k}{of}"
            rows.add("distribution", name, what, "1", "n: all ratings", float(number_of), len(given))
        if given and not _counted(scale):
            for what, share in QUARTILES.items():
                value = float(np.percentile(given, share))
                rows.add("distribution", name, f"{what}{of}", POINTS, "of all ratings", value, len(given))
    return section(
        "rating_versions",
        (_versions_table(ratings),),
        unrated=[spaced(name) for name in ratings.unrated],
        lacking=ratings.incomplete,
    )


def _add_spread(add: partial[None], sample: Sample, of: str) -> None:
    n, values = len(sample.of), sample.values
    one = "" if n > 1 else "one participant: no spread"
    sd, population = (float(values.std(ddof=ddof)) if n > 1 else None for ddof in (1, 0))
    for what, spread, by in zip(ERRORS, (sd, population), ("n - 1", "n"), strict=True):
        error = None if spread is None else spread / math.sqrt(n)
        add(f"{what}{of}", POINTS, f"SD with {by}, over the root of n", error, n, flag=one)
    add(f"standard deviation{of}", POINTS, "with n - 1", sd, n, flag=one)


def _mean_rating(sample: Sample, scale: RatingScale) -> Effect:
    """Return the mean over participants, with the interval of a mean difference from their median."""
    values = sample.values
    if not values.size:
        return Effect(None, flag="nobody has rated it")
    median = float(np.sort(values)[(values.size - 1) // 2])
    about = mean_difference(values - median, sample.step)
    low, high = (None if end is None else median + end for end in (about.ci_low, about.ci_high))
    alike = f"all {values.size} ratings are alike: the interval rests on two pseudo ratings"
    why = alike if about.flag else ""
    if values.size == 1:
        why = "one rating: no interval"
    return within(Effect(float(values.mean()), low, high, why), scale.lowest, scale.highest)


def _counted(scale: RatingScale) -> tuple[str, ...]:
    """Return the ratings whose numbers the table has; none where there are too many for that."""
    bins = bins_of(scale)
    return bins.names if bins.single and len(bins.names) <= MOST_COUNTS else ()


def _versions_table(ratings: Ratings) -> Table:
    scale, rows = ratings.data.scale, list[tuple[Cell, ...]]()
    counted = _counted(scale)
    for name in ratings.sequences:
        for v in (Version.BASELINE, Version.OURS):
            means, given = (partial(ratings.rows.find, table, name) for table in ("means", "distribution"))
            mean, ends = with_interval(means(f"mean rating, {v.value}"))
            errors = [number(means(f"{what}, {v.value}"))[0] for what in ERRORS]
            counts = [count(given(f"ratings of {k}, {v.value}"))[0] for k in counted]
            counts = counts or [number(given(f"{what}, {v.value}"))[0] for what in QUARTILES]
            n = len(ratings.means[name, v].of)
            rows.append((in_words(name), of_track(v.value), mean, *errors, ends, *counts, n))
    span = f"{scale.lowest:g} to {scale.highest:g}"
    words = f"how many ratings of {span} were given" if counted else f"quartiles of all ratings of {span}"
    given_names = [f"“{k}”" for k in counted] or list(QUARTILES)
    return Table(
        f"Ratings of each version: mean over n participants with 95 % confidence interval (CI), and {words}. "
        "The standard error of the mean (SEM) is the SD over the root of n; "
        "the SD is divided by n - 1, or by n (population SD).",
        ("sequence", "version", "mean", "SEM", "SEM, population SD", "95 % CI", *given_names, "n"),
        tuple(rows),
    )
