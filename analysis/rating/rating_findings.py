"""What the detail ratings show: numbers, a figure and words (the paper's Section 4.1)."""

from __future__ import annotations

from evenlight.analysis.figure_style import png_bytes
from evenlight.analysis.findings import Drawing, Findings
from evenlight.analysis.rating.rating_figure import rating_figure
from evenlight.analysis.rating.rating_pairs import incomplete
from evenlight.analysis.rating.rating_points import rating_points
from evenlight.analysis.rating.rating_power import ALPHA
from evenlight.analysis.rating.rating_results import PairResult, RatingResults, rating_results
from evenlight.analysis.rating.rating_sections import rating_sections
from evenlight.analysis.rating.rating_statistics import rating_statistics
from evenlight.analysis.session_loading import TaskData
from evenlight.analysis.wording import listed, p_in_words, spaced
from evenlight.data_schema.viewing import RatingTrial

NAME = "rating"


def rating_findings(data: TaskData[RatingTrial], seed: int) -> Findings:
    """Analyse the ratings of a data set.

    Parameters
    ----------
    data : TaskData of RatingTrial
        All sessions of the task.
    seed : int
        Of the permutations, and of the experiments that are drawn for the smallest difference.
    """
    results = rating_results(data, seed)
    caption = (
        f"Detail ratings of {results.people}: how often each rating was given to each version, and how the "
        "two differ for the same people (left of 0 the baseline is rated higher). Means with 95 % intervals."
    )
    drawing = Drawing("rating", png_bytes(rating_figure(results)), caption, rating_points(results))
    return Findings(
        name=NAME,
        lead=_lead(results),
        statistics=rating_statistics(results),
        drawings=(drawing,),
        sections=rating_sections(results, drawing.picture),
        warnings=(*data.warnings, *_warnings(results)),
    )


def _lead(results: RatingResults) -> str:
    """Return what came out, in a sentence or two."""
    overall, n = results.overall, len(results.overall.pairs.participant_ids)
    if overall.mean.value is None:
        return f"Of {results.people} nobody has rated both versions of a sequence: nothing can be compared."
    who = f"{n} {'simulated ' * results.simulated}participant{'s' * (n != 1)}"
    count = len(results.rated)
    over = f", over {count} sequences" if count > 1 else ""
    different = sum(p is not None and p <= ALPHA for p in results.adjusted)
    said = (
        f"The details of ours are rated {_mean_in_words(overall)} those of constant dimming by {who}{over}."
    )
    if all(p is None for p in results.adjusted):
        return f"{said} Nothing can be tested with so few."
    return (
        f"{said} Taken one by one, {different} of {count} sequence{'s' * (count != 1)} differ beyond chance "
        "(exact test, Holm)."
    )


def _mean_in_words(overall: PairResult) -> str:
    """Return the mean difference with its interval and test."""
    mean = overall.mean.value or 0.0
    words = f"{abs(mean):.2f} points {'higher' if mean > 0 else 'lower'} than" if mean else "no higher than"
    if overall.mean.ci_low is None or overall.flip is None:
        return words
    return (
        f"{words.rsplit(' ', 1)[0]} (95 % interval {overall.mean.ci_low:.2f} to {overall.mean.ci_high:.2f}, "
        f"exact {p_in_words(overall.flip.p_value)}) than"
    )


def _warnings(results: RatingResults) -> tuple[str, ...]:
    """Return what is amiss but does not forbid the use."""
    warnings = []
    if len(results.participant_ids) == 1:
        warnings.append("ratings of one participant: nothing can be tested, nothing is said of other people")
    if results.alike:
        who = ", ".join(f"{name} ({rating})" for name, rating in results.alike.items())
        warnings.append(f"participants who always gave the same rating: {who}")
    unrated = [spaced(name) for name in results.sequences if name not in results.rated]
    if unrated:
        warnings.append(f"nobody rated {listed(unrated)}: Holm's adjustment counts the other sequences only")
    lacking = incomplete([result.pairs for result in results.pairs if result.pairs.name in results.rated])
    if lacking:
        warnings.append(f"participants without both versions of every sequence: {', '.join(lacking)}")
    return tuple(warnings)
