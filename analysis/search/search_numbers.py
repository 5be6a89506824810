"""Every number of a search, added once as a row: what tables and figures show, and what is behind them.

A mean over the rings that were found (the paper's average) forgets the long searches; counting the undetected
ones with the time limit shortens them too. Both make versions look alike that differ in how many rings stay
undetected. Hence medians by Kaplan-Meier, and ratios by the model (`search_models`), beside those averages.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from evenlight.analysis.inference.binomial_tests import mid_p_interval
from evenlight.analysis.inference.exact_tests import holm
from evenlight.analysis.inference.fixed_effects import FixedEffect
from evenlight.analysis.inference.lognormal_times import TimesFit
from evenlight.analysis.inference.paired_effects import Effect
from evenlight.analysis.inference.survival_curves import kaplan_meier, restricted_mean
from evenlight.analysis.integrity.gate import SHORTEST_TIME
from evenlight.analysis.report import Cell
from evenlight.analysis.rows import Rows, ratio_with_interval
from evenlight.analysis.search import search_models as models
from evenlight.analysis.search import search_pairs as paired
from evenlight.analysis.search.search_pairs import SearchFlag
from evenlight.analysis.search.search_trials import (
    BrightnessEffect,
    SearchTable,
    first_sessions,
    search_table,
)
from evenlight.analysis.session_loading import TaskData
from evenlight.analysis.wording import participants
from evenlight.data_schema.analysis_results import Origin, Statistic
from evenlight.data_schema.arrays import Array, Integers, Mask
from evenlight.data_schema.recordings.search import ORIENTATIONS, SearchTrial

ALPHA = 0.05
SLOWING = 0.25  # more than that where ours dims would be a loss (choice; docs/decisions/search-inference.md)
EVERYWHERE = "all"
VERSIONS = {"ours": True, "baseline": False}
CHANCE = 1 / len(ORIENTATIONS)
SHORT = 2.0  # [s]
MARGIN = 1.2  # of an axis that ends before the time limit
NO_SD = 1e-4  # of ln(time): the likelihood is largest at 0, which a search for it nears

RATIO = "time ratio, ours / baseline"
LARGEST = "largest time ratio that is not excluded"
SLOPE = "change of ln(time) per ln(brightness ratio)"
CHECK = "time ratio at equal brightness (a check: 1)"
LIKE_LOCATIONS = "these people, at locations like these"
LIKE_PEOPLE = "people like these, at these locations"
LIKE_BOTH = "people and locations like these"
HALVES, TRIALS_LATER = "time ratio, second half / first half", "time ratio, ten trials later in a half"
HAZARD = "hazard ratio, ours / baseline"
FIRST = "pairs, ours found first - baseline found first"
WRONG = "wrong answers, ours - baseline"
MORE_FOUND = "number of rings found, ours - baseline"
CORRECT, GUESSED = "gaps identified correctly", "rings found without being seen"
FACTOR, FOUND, CHANGE = "brightness factor", "rings found", "rings found, ours - baseline"
LOST, MEDIAN = "undetected", "median search time"
MEAN, MEAN_ERROR = "mean of the rings found", "standard error of that mean"
MEAN_AT_LIMIT, MODEL_MEAN = "mean, undetected at the limit", "mean by the model"

SECONDARY = "secondary, not adjusted"
MODEL = "log-normal times, undetected rings censored; n: searches in the model"
SANDWICH = "of repeated searches: standard error over people (sandwich), Student's t"
CLUSTERED = (
    "Clopper-Pearson interval at the effective number of searches (Korn & Graubard 1998), of all or nothing "
    "at the number of participants; n: searches"
)
EXCHANGED = f"exact p: the versions exchanged person by person; {SECONDARY}; n: pairs"
OVER_PEOPLE = (
    "interval and p: Student's t over people, standard error at least that of independent pairs; "
    f"{SECONDARY}; n: pairs"
)
MCNEMAR = (
    "within people; exact test of McNemar, Holm over locations; interval: what the test does not reject, "
    "joined with that of Bonett and Price"
)
OF_MANY = (
    "within people; interval and p: Student's t over people, standard error at least that of independent "
    "pairs; Holm over locations"
)
KAPLAN_MEIER = "Kaplan-Meier; interval: log-log (Brookmeyer and Crowley)"

NO_SPREAD = "at its lower end: no difference between participants is seen"
NOT_TOLD = "the data do not tell it from the scatter of searches"
NO_COMBINATION = "the slope over people or over locations is missing"
NOT_VARIED = "does not vary in these data, or is unknown"
NOT_IN_MODELS = "nobody found a ring there, or only one version was searched in"
GUESSES = "not shown to be above chance (1/8): the times may be of guesses"
NOT_SEARCHED, NO_PAIR = "nobody searched there in this version", "nobody searched there in both versions"
NOBODY, ONE_FOUND = "nobody found the ring", "one ring found: no standard error"
LITTLE_FOUND = "too few were found for a model of the rest"
UNKNOWN = "it is unknown"


@dataclass(frozen=True, slots=True)
class Study:
    """A search, and its numbers.

    Attributes
    ----------
    table : SearchTable
        The trials.
    slowing : float
        Share by which ours may take longer where it dims, without that being a loss.
    pairs : SearchPairs
        Each session's two searches of a location.
    used : SearchTable
        The trials that are in the models.
    overall, brightness : TimesFit
        Of ln(time): with one effect of the version; with its slope over brightness.
    line : LocationLine or str
        Effect over brightness, over locations; or why there is none.
    sides : mapping of BrightnessEffect to int
        Locations in the models that ours brightens, dims, or leaves alike.
    rows : Rows
        Its numbers.
    """

    table: SearchTable
    slowing: float
    pairs: paired.SearchPairs
    used: SearchTable
    overall: TimesFit
    brightness: TimesFit
    line: models.LocationLine | str
    sides: Mapping[BrightnessEffect, int]
    rows: Rows

    @property
    def simulated(self) -> bool:
        """Whether simulated participants searched."""
        return self.rows.origin is Origin.SIMULATED

    @property
    def people(self) -> str:
        """How many, in words."""
        return participants(len(self.table.participants), self.simulated)

    @property
    def model(self) -> str:
        """How ratios of times are estimated."""
        return f"{MODEL}; {SANDWICH}" if self.table.repeated else MODEL

    @property
    def searches_each(self) -> tuple[int, int]:
        """How many searches a participant made at a location in a version: the fewest, and the most."""
        each = searches_of_cells(self.table)
        return int(each.min()), int(each.max())

    @property
    def digits(self) -> int:
        """Decimals of times in tables: more if searches are short."""
        return 1 if np.median(self.table.times) > SHORT else 2

    def span(self, limit: float) -> float:
        """Return how far an axis of times goes: to the limit, or less where nearly all took far less [s]."""
        found = self.table.times[self.table.found]
        furthest = MARGIN * float(np.quantile(found, 0.99)) if found.size else limit
        return furthest if furthest < limit / 4 else limit

    @property
    def most(self) -> float:
        """The largest ratio of times that searches can show."""
        return float(self.table.limits.max()) / SHORTEST_TIME

    @property
    def right_alone(self) -> Statistic | None:
        """The time ratio of right answers alone where wrong ones decide: None where the ratios agree.

        They do not where either lies outside the other's interval, or wrong answers are commoner in one
        version: the race takes them for searches cut short at any moment, of whatever difficulty.
        """
        find = self.rows.find
        ratio = find("versions", EVERYWHERE, RATIO)
        right = find("undetected", EVERYWHERE, f"{RATIO}; {models.RIGHT}")
        wrong = find("detections", EVERYWHERE, WRONG)
        if ratio is None or right is None or ratio.value is None or right.value is None:
            return None
        commoner = wrong is not None and wrong.p_value is not None and wrong.p_value <= ALPHA
        return right if commoner or not (_holds(ratio, right.value) and _holds(right, ratio.value)) else None

    def ratio(self, row: Statistic | None) -> tuple[Cell, Cell]:
        """Return a ratio of times and its interval, as tables show them."""
        return ratio_with_interval(row, self.most)

    @property
    def groups(self) -> dict[str, Mask]:
        """Which pairs are of all locations, and of those of either side; none without a pair."""
        sides = self.table.sides[self.pairs.location]
        chosen = {EVERYWHERE: np.ones(sides.size, bool)} | {
            side.value: sides == side for side in BrightnessEffect
        }
        return {name: mask for name, mask in chosen.items() if mask.any()}

    def group_of(self, side: BrightnessEffect) -> str:
        """Return the group of a side's time ratio."""
        return f"{side.value} ({self.sides[side]} locations)"


def _holds(row: Statistic, value: float) -> bool:
    return (row.ci_low or 0.0) <= value <= (math.inf if row.ci_high is None else row.ci_high)


def searches_of_cells(table: SearchTable) -> Integers:
    """Return the number of searches of each participant, location and version that come together."""
    cells = np.stack([table.participant, table.location, table.ours])
    return np.unique(cells, axis=1, return_counts=True)[1]


def study_of(data: TaskData[SearchTrial], slowing: float = SLOWING) -> tuple[Study, tuple[str, ...]]:
    """Return a search with all its numbers, and what is to be said about its trials.

    Raises
    ------
    InputError
        If only one of the two versions was searched in.
    """
    table, warnings = search_table(data)
    used = models.informative(table)
    by_location = models.effects_by_location(used)
    of_these_people = models.effects_by_location(used, over_people=False) if used.repeated else by_location
    ln_ratios = table.ln_ratios
    known = {k: effect for k, effect in of_these_people.items() if np.isfinite(ln_ratios[k])}
    at_sides, places = table.sides, np.unique(used.location)
    study = Study(
        table=table,
        slowing=slowing,
        pairs=paired.matched_pairs(table),
        used=used,
        overall=models.version_fit(table),
        brightness=models.brightness_fit(used),
        line=models.line_over_locations(known, ln_ratios) if known else SearchFlag.FACTORS_UNKNOWN.value,
        sides={side: int((at_sides[places] == side).sum()) for side in BrightnessEffect},
        rows=Rows(Origin.SIMULATED if data.simulated else Origin.RECORDED),
    )
    _add_version_rows(study)
    _add_brightness_rows(study)
    _add_order_rows(study)
    _add_pair_rows(study)
    _add_share_rows(study)
    for what, fit in models.treated_fits(table, study.overall).items():
        effect = models.effect_of(fit, models.VERSION)
        _add_ratio(study, "undetected", EVERYWHERE, effect, fit.n, f"{RATIO}; {what}")
    _add_location_rows(first_sessions(table), study.rows)
    _add_location_ratios(study, by_location)
    return study, warnings


def _add_ratio(study: Study, table: str, group: str, effect: FixedEffect, n: int, what: str = RATIO) -> None:
    study.rows.add(table, group, what, "1", f"{study.model}; {SECONDARY}", effect.shown(math.exp), n)


# --- models of the times ------------------------------------------------------------------------------------


def _add_version_rows(study: Study) -> None:
    fit, known, rows = study.overall, study.used.of_known_brightness, study.rows
    overall = models.effect_of(fit, models.VERSION)
    _add_ratio(study, "versions", EVERYWHERE, overall, fit.n)
    sides = known.sides[known.location]
    for side, effect in models.effects_by_side(study.used).items():
        group, n = study.group_of(side), int(np.count_nonzero(sides == side))
        _add_ratio(study, "versions", group, effect, n)
        method = (
            f"one-sided at 5 %, by the standard error; p: of a ratio of {1 + study.slowing:g} or more "
            f"(small: excluded); {SECONDARY}; n: searches"
        )
        p_value, largest = models.slowing(effect, math.log1p(study.slowing))
        most = FixedEffect("", largest, p_value=p_value, flags=effect.flags).shown(math.exp)
        rows.add("versions", group, LARGEST, "1", method, most, n)
    several = fit.n_groups > 1
    alone = NOT_TOLD if several else SearchFlag.ONE_PERSON_ONLY.value
    why = overall.shown().flag if fit.log_likelihood is None else alone
    for what, sd in (
        ("SD of ln(time) between searches", fit.residual_sd),
        ("SD of ln(time) between participants", fit.group_sd if several else None),
        ("SD of the effect of ours on ln(time) between participants", fit.slope_sd if several else None),
    ):
        spread = None if sd is None or math.isnan(sd) else sd
        flag = why if spread is None else NO_SPREAD if spread < NO_SD else ""
        rows.add("versions", EVERYWHERE, what, "1", MODEL, spread, fit.n, flag=flag)


def _add_brightness_rows(study: Study) -> None:
    fit, line, add = study.brightness, study.line, partial(study.rows.add, "brightness")
    method = "log-normal times; the slope differs between people; the primary test; n: participants"
    add(LIKE_PEOPLE, SLOPE, "1", method, models.people_slope(fit).shown(), fit.n_groups)
    _add_ratio(study, "brightness", EVERYWHERE, models.effect_of(fit, models.VERSION), fit.n, CHECK)
    if isinstance(line, str):
        add(LIKE_LOCATIONS, SLOPE, "1", "", None, flag=line)
        return
    n, people = len(line.locations), int(np.unique(study.table.participant).size)
    both = models.for_people_and_locations(models.effect_of(fit, models.BRIGHTNESS), line, people)
    of_both = both.shown() if both else Effect(None, flag=NO_COMBINATION)
    about = "line through the ratios of the locations, which scatter about it (REML)"
    add(LIKE_LOCATIONS, SLOPE, "1", f"{about}; {SECONDARY}; n: locations", line.slope.shown(), n)
    method = f"both scatters (quasi-F, Satterthwaite); {SECONDARY}; n: locations"
    add(LIKE_BOTH, SLOPE, "1", method, of_both, n)
    what, method = (
        "SD of locations about the line, in ln(time)",
        "restricted maximum likelihood; n: locations",
    )
    add(EVERYWHERE, what, "1", method, line.scatter, n)


def _add_order_rows(study: Study) -> None:
    fit = study.overall
    varied = {effect.name: effect for effect in fit.effects}
    for name, what in ((models.VISIT, HALVES), (models.ORDER, TRIALS_LATER)):
        if name in varied:
            _add_ratio(study, "order", EVERYWHERE, varied[name], fit.n, what)
        else:
            study.rows.add("order", EVERYWHERE, what, "1", "", None, fit.n, flag=NOT_VARIED)


# --- pairs and shares ---------------------------------------------------------------------------------------


def _add_pair_rows(study: Study) -> None:
    """Add which version was found first, and in which more rings were found, by group of locations."""
    groups = {name: study.pairs.at(mask) for name, mask in study.groups.items()}
    for group, pairs in groups.items():
        add, n = partial(study.rows.add, "first found", group), int(np.count_nonzero(pairs.first))
        method = f"Cox, stratified by participant and location; {OVER_PEOPLE}"
        add(HAZARD, "1", method, paired.hazard_ratio(pairs).shown(math.exp), n)
        add(FIRST, "1", EXCHANGED, paired.exchanged(pairs, pairs.first), n)
        for kind, number in pairs.counts.items():
            add(f"pairs, {kind}", "1", "", float(number))
    for group, pairs in groups.items():
        add, n = partial(study.rows.add, "detections", group), pairs.first.size
        add(CHANGE, "1", f"within people and locations; {OVER_PEOPLE}", paired.detection_change(pairs), n)
        add(MORE_FOUND, "1", EXCHANGED, paired.exchanged(pairs, pairs.more), n)
    if groups and study.table.wrong.any():
        pairs = paired.matched_pairs(replace(study.table, found=study.table.wrong))
        add, n, method = partial(study.rows.add, "detections", EVERYWHERE), pairs.first.size, OVER_PEOPLE
        add(WRONG, "1", f"within people and locations; {method}", paired.detection_change(pairs), n)


def _add_share_rows(study: Study) -> None:
    table, unknown = study.table, "" if study.table.gaps_known else UNKNOWN

    def add(rows: str, what: str, method: str, effect: Effect, n: int, flag: str = "") -> None:
        study.rows.add(rows, EVERYWHERE, what, "1", method, effect, n, flag=flag)

    for version, ours in VERSIONS.items():
        own = table.some(table.ours == ours)
        told = own.some(own.found & own.gaps_known)
        found, correct = (
            paired.clustered_share(own.found, own.participant),
            paired.clustered_share(told.correct, told.participant),
        )
        add("detections", f"{FOUND}, {version}", CLUSTERED, found, own.found.size)
        add("orientation", f"{CORRECT}, {version}", CLUSTERED, correct, told.found.size, unknown)
        method = "(1 - share identified correctly) / (7/8): guesses hit one in eight"
        add("orientation", f"{GUESSED}, {version}", method, _guessed(correct), told.found.size, unknown)


def _guessed(correct: Effect) -> Effect:
    if correct.value is None:
        return correct
    above_chance = correct.ci_low is not None and correct.ci_low > CHANCE
    return Effect(min((1 - correct.value) / (1 - CHANCE), 1.0), flag="" if above_chance else GUESSES)


# --- each location by itself --------------------------------------------------------------------------------


def _add_location_rows(once: SearchTable, rows: Rows) -> None:
    """Add what was found at each location in either version: once by each person, or repeatedly."""
    pairs = paired.matched_pairs(once)
    at = [pairs.at(pairs.location == k) for k in range(len(once.locations))]
    none = Effect(None, flag=NO_PAIR)
    test, method = (paired.detection_change, OF_MANY) if once.repeated else (paired.detections, MCNEMAR)
    tests = [test(own) if own.first.size else none for own in at]
    adjusted = holm([test.p_value for test in tests])
    for k, (place, found) in enumerate(zip(once.locations, tests, strict=True)):
        add = partial(rows.add, "locations", place.name)
        for version, ours in VERSIONS.items():
            own = once.some((once.location == k) & (once.ours == ours))
            factor = place.ours if ours else place.baseline
            flag = NOT_SEARCHED if not own.found.size else "" if factor is not None else UNKNOWN
            add(f"{FACTOR}, {version}", "1", "", factor, flag=flag, origin=Origin.COMPUTED)
            if own.found.size:
                _add_cell_rows(rows, place.name, version, own)
        if found is none:
            add(CHANGE, "1", "", found)
        else:
            add(CHANGE, "1", method, found, at[k].first.size, p_adjusted=adjusted[k])


def _add_cell_rows(rows: Rows, place: str, version: str, own: SearchTable) -> None:
    n, n_found, seen = own.found.size, int(own.found.sum()), own.times[own.found]
    curve, of = kaplan_meier(own.times, own.found, own.participant if own.repeated else None), f", {version}"
    add, average = (partial(rows.add, table, place) for table in ("locations", "averages"))
    share, how = Effect(n_found / n, *mid_p_interval(n_found, n)), "interval: mid-p"
    if own.repeated:
        share, how = paired.clustered_share(own.found, own.participant), CLUSTERED
    add(f"{FOUND}{of}", "1", how, share, n)
    add(f"{LOST}{of}", "1", "", float(n - n_found), n)
    method = f"{KAPLAN_MEIER}, standard error over people" if own.repeated else KAPLAN_MEIER
    add(f"{MEDIAN}{of}", "s", method, curve.median, n)

    none, method = "" if n_found else NOBODY, "the paper's; undetected rings are left out"
    average(f"{MEAN}{of}", "s", method, float(seen.mean()) if n_found else None, n_found, flag=none)
    error = float(seen.std(ddof=1)) / math.sqrt(n_found) if n_found > 1 else None
    if own.repeated and error is not None:
        error = paired.error_over_people(seen - seen.mean(), own.participant[own.found])
    flag = "" if error is not None else none or ONE_FOUND
    method = "over people" if own.repeated else "SD with n - 1"
    average(f"{MEAN_ERROR}{of}", "s", method, error, n_found, flag=flag)
    method = "undetected rings count with the time limit"
    average(f"{MEAN_AT_LIMIT}{of}", "s", method, float(own.times.mean()), n)
    method = "area under the Kaplan-Meier curve up to the shortest time limit"
    average(f"restricted mean{of}", "s", method, restricted_mean(curve, float(own.limits.min())), n)
    modelled = _log_normal_mean(own.model_times, own.found)
    method = "log-normal distribution of this version here, undetected rings censored"
    flag = "" if modelled is not None else none or LITTLE_FOUND
    average(f"{MODEL_MEAN}{of}", "s", method, modelled, n, flag=flag)


def _log_normal_mean(times: Array, found: Mask) -> float | None:
    """Return the mean e^(μ + σ²/2) of a log-normal distribution fitted by maximum likelihood.

    None where fewer than half, or fewer than three, were found: it would be made of what nobody saw.
    """
    from scipy import stats

    logs = np.log(times)
    if np.count_nonzero(found) < max(3, times.size / 2) or np.ptp(logs[found]) == 0:
        return None
    if found.all():
        return float(np.exp(logs.mean() + logs.var() / 2))
    censored = stats.CensoredData.right_censored(logs, ~found)
    mu, sigma = stats.norm.fit(censored)
    return float(np.exp(mu + sigma**2 / 2))


def _add_location_ratios(study: Study, effects: Mapping[int, FixedEffect]) -> None:
    """Add the ratio of times at each location, by itself and drawn to the line over all of them."""
    adjusted = dict(zip(effects, holm([effect.p_value for effect in effects.values()]), strict=True))
    names, add = [place.name for place in study.table.locations], partial(study.rows.add, "locations")
    method, none = f"{study.model}; p adjusted over locations (Holm)", FixedEffect("")
    for k, name in enumerate(names):
        ratio, n = effects.get(k, none).shown(math.exp, NOT_IN_MODELS), int((study.used.location == k).sum())
        add(name, RATIO, "1", method, ratio, n, p_adjusted=adjusted.get(k))
    if isinstance(study.line, str):
        return
    method = "best linear prediction: between its own ratio and the line over brightness"
    for k, value in zip(study.line.locations, study.line.shrunken, strict=True):
        what, n = "time ratio, drawn to the line", len(study.line.locations)
        add(names[k], what, "1", method, math.exp(value), n)
