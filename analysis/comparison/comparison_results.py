"""All numbers of the artifact comparison: of each sequence, of all answers, of the order, of guessing.

All answers together go into a mixed logistic regression (the paper's Section 4.3),

    logit P(ours chosen) = preference_i + leaning · s,    s = 1 if ours came first, -1 if second,

with the preference of participant i normal about the population's. Whether ours is chosen more often than by
a coin is the question whether the population's preference is 0; s takes out a bias to an interval, where the
order is not balanced.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from scipy import special

from evenlight.analysis.comparison.comparison_shares import (
    ONE_WAY,
    PERMUTATIONS,
    ShareEstimate,
    consistency_of,
    count_choices,
    estimate_share,
    joined_flags,
    sequence_differences,
)
from evenlight.analysis.inference import binomial_tests as binomial
from evenlight.analysis.inference.binomial_tests import ALPHA, HALF
from evenlight.analysis.inference.cumulative_link import (
    OrdinalData,
    OrdinalFit,
    fit_ordinal,
    shown_effect,
    shown_spread,
)
from evenlight.analysis.inference.exact_tests import holm, sign_flip_test
from evenlight.analysis.inference.paired_effects import Effect
from evenlight.analysis.rows import Rows
from evenlight.analysis.session_loading import TaskData
from evenlight.analysis.wording import listed, spaced
from evenlight.data_schema.analysis_results import Origin, Statistic
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.ramp import Response
from evenlight.data_schema.recordings.viewing import ComparisonTrial

RARE = 0.2  # share of the rarer order below which the order counts as nearly constant: 3 of 17
OURS_FIRST = 1  # interval
WITHIN = (binomial.bayes_factor_within, binomial.posterior_within)
POWER = 0.8
ALL = "all"
CHOSEN, FIRST = "ours chosen", "first of the two chosen"
AGREEMENT, DIFFERENCE = "agreement of people with themselves", "difference between sequences"
SMALLEST_MARGIN = "smallest margin shown at 5 %"
PREFERENCE = "ours chosen by a person in the middle"
LEANING = "first chosen by a person in the middle"
METHOD = "mixed logistic regression, participant random; likelihood ratio, profile interval"


@dataclass(frozen=True, slots=True)
class IntervalOrder:
    """How often ours came first.

    Attributes
    ----------
    ours_first, trials : int
        How often, of how many.
    unknown : int
        Trials beside them of which it is not known.
    """

    ours_first: int
    trials: int
    unknown: int = 0

    @property
    def constant(self) -> bool:
        """Whether ours came always in the same interval, as far as that is known."""
        return self.trials + self.unknown > 0 and self.ours_first in (0, self.trials)

    @property
    def flag(self) -> str:
        """What the order makes of a share; empty where both orders are frequent enough."""
        if self.unknown:
            return (
                f"the interval of the track is unknown in {self.unknown} of {self.trials + self.unknown} "
                "trials: its choice cannot be told from a leaning to one interval"
            )
        rarer = min(self.ours_first, self.trials - self.ours_first)
        if rarer >= RARE * self.trials:
            return ""
        where = "first" if self.ours_first > rarer else "second"
        cause = "cannot be told" if self.constant else "can hardly be told"
        return (
            f"the track came {where} in {self.trials - rarer} of {self.trials} trials: its choice {cause} "
            "from a leaning to that interval"
        )


def _order_of(trials: Iterable[ComparisonTrial]) -> IntervalOrder:
    intervals = [None if trial.response is None else trial.ours_interval for trial in trials]
    unknown = intervals.count(None)
    return IntervalOrder(intervals.count(OURS_FIRST), len(intervals) - unknown, unknown)


@dataclass(frozen=True, slots=True)
class Comparison:
    """What an artifact comparison shows.

    Attributes
    ----------
    data : TaskData of ComparisonTrial
        The answers.
    margin : float
        Within which a share counts as equivalent to one half.
    shares : mapping of str to ShareEstimate or None
        Of each sequence, in the order of the design; None without an answer.
    orders : mapping of str to IntervalOrder
        How often ours came first, of each sequence.
    pooled : ShareEstimate
        Of all answers.
    order : IntervalOrder
        Of all trials.
    first : ShareEstimate or None
        Share of the first of the two, of all answers whose order is known; None without any.
    rows : Rows
        Every number.
    """

    data: TaskData[ComparisonTrial]
    margin: float
    shares: Mapping[str, ShareEstimate | None]
    orders: Mapping[str, IntervalOrder]
    pooled: ShareEstimate
    order: IntervalOrder
    first: ShareEstimate | None
    rows: Rows = field(repr=False)

    @property
    def people(self) -> int:
        """How many participants there are."""
        return self.pooled.choices.people

    @property
    def within(self) -> str:
        """What counts as equivalent to one half, in words."""
        return f"0.5 ± {self.margin:g}"

    @property
    def odds(self) -> tuple[str, str, str]:
        """What is said of one half in the way of Bayes."""
        within = self.within
        return "Bayes factor for 0.5", f"Bayes factor for {within}", f"probability of {within}"

    @property
    def listed(self) -> dict[str, ShareEstimate | None]:
        """What tables and figures list: the sequences, then all answers where there are several."""
        return {**self.shares, ALL: self.pooled} if len(self.shares) > 1 else dict(self.shares)

    def beyond_chance(self, table: str) -> list[str]:
        """Return the sequences whose adjusted p in a table, "shares" or "equivalence", is at most 5 %."""
        return [r.group for r in self.rows.of(table) if r.p_adjusted is not None and r.p_adjusted <= ALPHA]

    def guessing(self, what: str) -> Statistic | None:
        """Return a number that is held against guessing, if there is one."""
        row = self.rows.find("guessing", ALL, what)
        return row if row and row.value is not None else None

    @property
    def contradictory(self) -> bool:
        """Whether sequences differ, from one half or from each other: one share is then none of theirs."""
        apart = self.guessing(DIFFERENCE)
        return bool(self.beyond_chance("shares")) or (apart is not None and _small(apart.p_value))

    @property
    def answers_per_sequence(self) -> list[int]:
        """How many people answered about each sequence, the commonest number first.

        One answer of each is what counts as independent, however often they were asked.
        """
        asked = [share.choices.people for share in self.shares.values() if share is not None]
        return sorted(asked, key=lambda n: (-asked.count(n), -n))


def _small(p_value: float | None) -> bool:
    return p_value is not None and p_value <= ALPHA


def compare(data: TaskData[ComparisonTrial], seed: int, margin: float) -> Comparison:
    """Return what an artifact comparison shows; refuse data without an answer, and a margin that is none."""
    if not 0 < margin < 0.5:
        raise InputError(f"the margin about a share of 0.5 must lie between 0 and 0.5, got {margin:g}")
    trials = data.trials
    if not trials:
        raise InputError("no comparison counts: expected at least one that is neither practice nor flagged")
    names = tuple(dict.fromkeys((*data.designed_sequences, *(trial.sequence for trial in trials))))
    own = {name: [trial for trial in trials if trial.sequence == name] for name in names}
    orders = {name: _order_of(own[name]) for name in names}
    shares = {name: _share(own[name], margin, orders[name]) if own[name] else None for name in names}
    order, rows = _order_of(trials), Rows(Origin.SIMULATED if data.simulated else Origin.RECORDED)
    pooled = _share(trials, margin, order)
    ordered = [trial for trial in trials if trial.response is not None]
    first = _share(ordered, margin, order, _chose_first) if ordered else None
    found = Comparison(data, margin, shares, orders, pooled, order, first, rows)
    guessing = _guessing(found, np.random.default_rng(seed))
    different = holm([share.difference.p_value if share else None for share in shares.values()])
    equal = holm([share.equivalence.p_value if share else None for share in shares.values()])
    for name, *p_adjusted in zip(names, different, equal, strict=True):
        _add_share(found, name, shares[name], *p_adjusted)
    apart = any(map(_small, different)) or _small(guessing[1].p_value)
    words = "the sequences differ from one half or from each other: a share of them all tells of none"
    _add_share(found, ALL, pooled.flagged(words if apart else ""))
    _add_pooled(found)
    _add_model(found, choice_model(trials))
    rows.extend(guessing)
    return found


def _chose_first(trial: ComparisonTrial) -> bool:
    return trial.response is Response.FIRST


def _share(
    trials: Sequence[ComparisonTrial],
    margin: float,
    order: IntervalOrder,
    *chosen: Callable[[ComparisonTrial], bool],
) -> ShareEstimate:
    return estimate_share(count_choices(trials, *chosen), margin).flagged(order.flag)


def _add_share(
    found: Comparison,
    group: str,
    share: ShareEstimate | None,
    different: float | None = None,
    equal: float | None = None,
) -> None:
    """Add a share, its equivalence to one half, and the odds for that; with both p adjusted."""
    rows, within = found.rows, found.within
    if share is None:
        rows.add("shares", group, CHOSEN, "1", "", None, 0, flag="nobody compared it")
        return
    n, flag, independent = share.choices.people, share.difference.flag, share.choices.one_each
    exact = independent or share.method == ONE_WAY
    test = "exact binomial" if exact else "Student's t over participants"
    rows.add("shares", group, CHOSEN, "1", share.method, share.difference, n, p_adjusted=different)
    what, by = f"share within {within}", f"two one-sided tests, {test}"
    rows.add("equivalence", group, what, "1", by, share.equivalence, n, p_adjusted=equal, level=0.9)
    by = "farther end of the 90 % interval"
    rows.add("equivalence", group, SMALLEST_MARGIN, "1", by, share.smallest_margin, n, flag=flag)
    odds: tuple[float | None, ...] = (None, None, None)
    why = "answers of one person are not independent"
    if independent:
        count = int(share.choices.chosen.sum()), share.choices.total
        mid_p = Effect(share.choices.share, *binomial.mid_p_interval(*count), flag)
        what, by = f"{CHOSEN}, mid-p interval", "holds the true share so often on average"
        rows.add("shares", group, what, "1", by, mid_p, n)
        within_margin = (own(*count, found.margin) for own in WITHIN)
        odds, why = (binomial.bayes_factor(*count), *within_margin), flag
    ways = ("against any share (uniform)", "against outside; uniform in each", "uniform prior")
    for what, own, by in zip(found.odds, odds, ways, strict=True):
        rows.add("bayes", group, what, "1", by, own, n, flag=why)


def _add_pooled(found: Comparison) -> None:
    """Add the mid-p, as the exact test is strict where few sums are possible; and the leaning."""
    rows, choices, flag = found.rows, found.pooled.choices, found.pooled.difference.flag
    what, by = f"{CHOSEN}, mid-p of the sign-flip test", "sums as extreme as that found count one half"
    mid_p = sign_flip_test(choices.scores, mid_p=True).p_value
    rows.add("shares", ALL, what, "1", by, choices.share, found.people, p=mid_p, flag=flag)
    first = found.first
    if first is None:
        rows.add("order", ALL, FIRST, "1", "", None, 0, flag=found.order.flag)
        return
    rows.add("order", ALL, FIRST, "1", first.method, first.difference, first.choices.people)


def _add_model(found: Comparison, fit: OrdinalFit) -> None:
    """Add what the model says, as shares of a person in the middle, and how people differ."""
    order, add = found.order, partial(found.rows.add, "model", ALL)
    for what, effect in [(PREFERENCE, fit.intercept), *((LEANING, effect) for effect in fit.effects)]:
        if effect is None:
            continue
        shown = shown_effect(fit, effect).shown(lambda x: float(special.expit(x)), "")
        said = [] if shown.value is None else [own.value for own in fit.flags]
        flag = joined_flags(shown.flag, *said, order.flag if what == PREFERENCE else "")
        add(what, "1", METHOD, replace(shown, flag=flag), fit.n_groups)
    if order.constant:
        add(LEANING, "1", METHOD, None, fit.n_groups, flag=order.flag)
    spread, why = shown_spread(fit, fit.group_sd)
    add("SD of the preference between participants", "log-odds", METHOD, spread, fit.n_groups, flag=why)


def choice_model(trials: Sequence[ComparisonTrial]) -> OrdinalFit:
    """Return the fitted model of at least one trial; no leaning where ours came always in one interval."""
    leaning = {OURS_FIRST: 1.0, None: 0.0}
    order = np.array([[leaning.get(trial.ours_interval, -1.0)] for trial in trials])
    known = np.ptp(order) > 0
    place = {who: k for k, who in enumerate(sorted({trial.participant_id for trial in trials}))}
    return fit_ordinal(
        OrdinalData(
            responses=np.array([trial.chose_ours for trial in trials], dtype=np.int64),
            n_categories=2,
            design=order if known else order[:, :0],
            names=(LEANING,) if known else (),
            groups=np.array([place[trial.participant_id] for trial in trials], dtype=np.int64),
        )
    )


def _guessing(found: Comparison, rng: np.random.Generator) -> Rows:
    """Return what is held against guessing, as rows that come after all others."""
    rows, people = Rows(found.rows.origin), found.people
    ratio, p_value = consistency_of(found.pooled.choices) or (None, None)
    by = "sum of squared scores over what guessing gives; exact, one-sided"
    why = "nobody answered twice" if ratio is None else ""
    rows.add("guessing", ALL, AGREEMENT, "1", by, ratio, people, p=p_value, flag=why)
    answered = [name for name, share in found.shares.items() if share is not None]
    spread, p_value = sequence_differences(found.data.trials, answered, rng) or (None, None)
    by = f"largest share less smallest; {PERMUTATIONS} permutations within participants (Cochran's Q)"
    uneven = [spaced(name) for name, order in found.orders.items() if order.flag]
    why = f"the track came nearly always in one interval in {listed(uneven)}" if uneven else ""
    why = "nobody compared two sequences" if spread is None else why
    rows.add("guessing", ALL, DIFFERENCE, "1", by, spread, people, p=p_value, flag=why)
    return rows


def add_limits(rows: Rows, n: int, margin: float) -> dict[str, float | None]:
    """Add what n independent answers can show about a share, whatever they are; return it by key.

    >>> rows = Rows(Origin.COMPUTED)
    >>> add_limits(rows, 17, 0.15)["fewest_different"], rows[0].what
    (13, 'answers for one version from which on p < 0.05')
    """
    found: dict[str, float | None] = {"answers": n}
    by, beyond = (
        "exact, over all outcomes; n independent answers",
        f"more than {binomial.MOST_ANSWERS} answers",
    )

    def add(key: str, what: str, value: float | None, why: str = "") -> None:
        found[key], own = value, None if value is None else float(value)
        flag = why if value is None else ""
        rows.add("limits", f"{n} answers", what, "1", by, own, n, flag=flag, origin=Origin.COMPUTED)

    few = int(binomial.lower_critical(n))
    fewest, size = n - few if few >= 0 else None, float(binomial.difference_power(n, HALF))
    add("fewest_different", "answers for one version from which on p < 0.05", fewest, "no number of them")
    add("type_i_error", "type I error of the exact test", size)
    what, none = "smallest share above 0.5 found with 80 % power", "no share is found: too few answers"
    add("share_found", what, binomial.smallest_share_found(n, POWER), none)
    threshold = float(binomial.difference_power(n, 0.75))  # that of a two-interval calibration
    add("threshold_power", "power for a share of 0.75", threshold)
    add("margin_ever", "smallest margin about 0.5 that they could show", binomial.smallest_margin_ever(n))
    power = float(binomial.equivalence_power(n, HALF, margin))
    add("equivalence_power", f"power to show a share of 0.5 within ±{margin:g}", power)
    equal = binomial.answers_for_equivalence(margin, POWER)
    add("answers_equivalent", "answers that show it with 80 % power", equal, beyond)
    different = binomial.answers_to_find(HALF + margin, POWER)
    add("answers_different", f"answers that find {HALF + margin:g} with 80 % power", different, beyond)
    coverage = binomial.interval_coverage(n, np.linspace(0.2, 0.8, 601), mid_p=False)
    covered = "coverage of the 95 % interval for shares of 0.2 to 0.8"
    add("lowest_coverage", f"lowest {covered}", float(coverage.min()))
    add("highest_coverage", f"highest {covered}", float(coverage.max()))
    return found
