"""Claims about searches that a lab repeats: all count, as in a mixed model, and people are the sample."""

import dataclasses
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from made_searches import SearchTruth, made_table, task_data, trials_of
from matplotlib.text import Text
from repeated_searches import DIFFERENT, PLACE, VERSIONS, repeated_table, study
from scipy import stats
from statsmodels.regression.mixed_linear_model import MixedLM

import evenlight
from evenlight.analysis.figure_style import PAGE
from evenlight.analysis.inference.mixed_designs import people_reference
from evenlight.analysis.inference.survival_curves import kaplan_meier
from evenlight.analysis.search.search_brightness_figure import curves_figure
from evenlight.analysis.search.search_findings import lead_of, pairs_section, times_section
from evenlight.analysis.search.search_models import (
    RIGHT,
    VERSION,
    effect_of,
    effects_by_location,
    version_fit,
)
from evenlight.analysis.search.search_numbers import RATIO, Study, study_of
from evenlight.analysis.search.search_pairs import detection_change, matched_pairs
from evenlight.analysis.search.search_times_figure import times_figure
from evenlight.analysis.search.search_trials import SearchTable
from evenlight.data_schema.analysis_results import Statistic
from evenlight.data_schema.mapping import mapping_from_record, record_from_mapping
from evenlight.data_schema.recordings.search import SearchTrial
from evenlight.data_schema.recordings.viewing import Version, repetitions
from evenlight.data_schema.storage.tables import read_rows
from evenlight.tables import _with_repetitions


def lab_table(repetitions: int, seed: int = 6) -> pd.DataFrame:
    """12 people, 6 cells, so many searches in each: ratio 0.926, people differ as in a public table.

    Its interval of 0.876 to 0.977 is 1.96 standard errors of 0.0278 to each side: an SD of √12 of these.
    """
    rng = np.random.default_rng(seed)
    person, place, ours, _ = (
        axis.ravel() for axis in np.meshgrid(range(12), range(3), (0, 1), range(repetitions), indexing="ij")
    )
    own, slope = 0.3 * rng.standard_normal(12), np.log(0.926) + 0.0278 * 12**0.5 * rng.standard_normal(12)
    ln_time = 0.1 + own[person] + 0.15 * place + slope[person] * ours + 0.3 * rng.standard_normal(ours.size)
    table = pd.DataFrame(
        {"participant_id": [f"S{p:02d}" for p in person], "sequence": np.array(["a", "b", "c"])[place],
         "keypoint": "1", "version": np.where(ours, "ours", "baseline"), "found": True,
         "search_time_s": np.exp(ln_time).round(4), "time_limit_s": 20.0}
    )  # fmt: skip
    table = table.sample(frac=1, random_state=seed, ignore_index=True)
    table["trial_index"] = table.groupby("participant_id").cumcount() + 1
    return table


def mixed_model(table: pd.DataFrame) -> tuple[float, float]:
    """ln of the time ratio and its standard error, by restricted likelihood, people differing in both."""
    ours = (table.version == "ours").to_numpy(float)
    design = np.column_stack([ours, pd.get_dummies(table.sequence).to_numpy(float)])
    random = np.column_stack([np.ones_like(ours), ours])
    model = MixedLM(np.log(table.search_time_s), design, table.participant_id, exog_re=random)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # tries several optimizers
        fit = model.fit()
    return float(fit.params.iloc[0]), float(fit.bse.iloc[0])


@pytest.mark.parametrize("repetitions", [20, pytest.param(197, marks=pytest.mark.slow)])
def test_time_ratio_and_interval_are_those_of_a_mixed_model_of_all_trials(repetitions: int) -> None:
    table = lab_table(repetitions)
    estimate, error = mixed_model(table)
    found = evenlight.analyze(table)
    ratio = next(row for row in found.rows if (row.group, row.what) == ("all", RATIO))
    n = 12 * 6 * repetitions
    assert ratio.n == n
    assert ratio.value == pytest.approx(np.exp(estimate), abs=0.001)
    half = stats.t.ppf(0.975, 11) * error  # of 12 people; the mixed model's own takes infinitely many
    assert (ratio.ci_low, ratio.ci_high) == pytest.approx(
        np.exp([estimate - half, estimate + half]), abs=0.005
    )
    assert found.lead.endswith(f"12 participants; 0 of {n} searches found nothing.")
    first = found.sections[0].paragraphs[0]
    assert first.startswith(f"12 participants looked for a ring {n} times, at 3 locations; 0 searches ended")
    assert f"Each person looked {repetitions} times for a ring at each location in each version." in first
    assert not found.warnings


def test_an_imported_table_counts_all_of_its_searches(command, tmp_path: Path) -> None:
    lab_table(3).to_csv(tmp_path / "table.csv", index=False)
    imported = command("import", tmp_path / "table.csv", "--task", "search", "--out", tmp_path / "lab")
    assert "repetition: by trial_index" in imported.out
    assert "216 trials" in imported.out
    done = command("analyze", tmp_path / "lab", "--out", tmp_path / "out")
    assert (done.code, done.err) == (0, "")
    rows = read_rows(Statistic, tmp_path / "out/search_statistics.csv")
    assert next(row.n for row in rows if (row.group, row.what) == ("all", RATIO)) == 216


def test_repetitions_may_be_numbered_or_follow_from_the_rows() -> None:
    table = lab_table(3)
    numbered = table.assign(
        repetition=table.groupby(["participant_id", "sequence", "version"]).cumcount() + 1
    )
    ways = [evenlight.analyze(own).lead for own in (table, numbered, table.drop(columns="trial_index"))]
    assert ways[0] == ways[1]
    assert "of 216 searches" in ways[2]


def test_sessions_that_have_each_cell_once_repeat_it() -> None:
    table = lab_table(3)
    block = table.groupby(["participant_id", "sequence", "version"]).cumcount() + 1
    found = evenlight.analyze(table.assign(session_id=block.astype(str)))
    assert not found.warnings
    assert {row.n for row in found.rows if row.group == "a/1" and row.what.startswith("undetected")} == {36}
    together = evenlight.analyze(table)
    ratios = [next(row.value for row in own.rows if row.what == RATIO) for own in (found, together)]
    assert ratios[0] == pytest.approx(ratios[1], rel=1e-6)


def test_repetitions_are_counted_by_session_then_trial_in_tables_and_imports(command, tmp_path: Path) -> None:
    table = lab_table(4)
    table["session_id"] = np.where(table.trial_index <= 12, "2", "10")
    table["trial_index"] = (table.trial_index - 1) % 12 + 1
    by_number = table.assign(number=table.session_id.astype(int)).sort_values(["number", "trial_index"])
    cell = ["participant_id", "sequence", "version"]
    expected = (by_number.groupby(cell).cumcount() + 1).sort_index().tolist()
    assert repetitions(table.to_dict("records"), (*cell, "keypoint")) == expected
    assert [row["repetition"] for row in _with_repetitions(table.to_dict("records"))] == expected
    table.to_csv(tmp_path / "table.csv", index=False)
    assert command("import", tmp_path / "table.csv", "--task", "search", "--out", tmp_path / "lab").code == 0
    files = sorted((tmp_path / "lab").rglob("sub-*/ses-*/*/*.tsv"))
    trials = pd.concat([pd.read_csv(file, sep="\t", dtype={"session_id": str}) for file in files])
    where = ["participant_id", "session_id", "trial_index"]
    both = table.assign(expected=expected).merge(trials, on=where)
    assert len(both) == len(table)
    assert both.expected.tolist() == both.repetition.tolist()


def test_a_search_of_an_earlier_file_is_the_first() -> None:
    truth = SearchTruth(participants=2, locations=1)
    plain = mapping_from_record(trials_of(made_table(truth, np.random.default_rng(1)))[0])
    del plain["repetition"]
    assert record_from_mapping(SearchTrial, plain, "file").repetition == 1


def repeated(**truth: float) -> SearchTable:
    return repeated_table(dataclasses.replace(DIFFERENT, **truth), np.random.default_rng(5))


def results(table: SearchTable) -> Study:
    """The study of a table, through the records of its trials."""
    one = trials_of(made_table(SearchTruth(participants=1, locations=1), np.random.default_rng(1)))[0]
    one = dataclasses.replace(one, ring_place=None, ring_orientation=None, reported_orientation=None, block=1)
    trials = []
    for k in range(table.times.size):
        place, ours = table.locations[table.location[k]], bool(table.ours[k])
        trials.append(dataclasses.replace(
            one, participant_id=table.participants[table.participant[k]], trial_index=k,
            sequence=place.sequence, keypoint=place.keypoint,
            version=Version.OURS if ours else Version.BASELINE, factor=place.ours if ours else place.baseline,
            found=bool(table.found[k]), search_time=float(table.times[k]), time_limit=float(table.limits[k]),
            repetition=1 + int(table.repetition[k]),
        ))  # fmt: skip
    return study_of(task_data(trials))[0]


def test_a_wrong_answer_is_an_outcome_that_ends_a_search() -> None:
    table = repeated()
    wrong, lost = int(table.wrong.sum()), int((~table.found & ~table.wrong).sum())
    assert min(wrong, lost) > 10
    study = results(table)
    words = f"{lost} of {table.times.size} searches found nothing, {wrong} ended with a wrong answer."
    assert lead_of(study).endswith(words)
    assert (
        f"{lost} searches ended without success, and {wrong} with a wrong answer"
        in (times_section(study).paragraphs[0])
    )
    right = study.rows.find("undetected", "all", f"{RATIO}; {RIGHT}")
    assert right is not None
    assert right.n == table.times.size - wrong
    alone = effect_of(version_fit(study.table.some(~study.table.wrong)), VERSION)
    assert right.value == pytest.approx(np.exp(alone.estimate or 0.0))


def wrong_answers(kind: str) -> pd.DataFrame:
    """A lab's table with wrong answers anywhere, in the track, or early in it and late in the baseline."""
    table, rng = lab_table(20), np.random.default_rng(9)
    ours, chance = table.version == "ours", rng.random(len(table))
    rank = table.groupby(["participant_id", "version"]).search_time_s.rank(pct=True)
    early_or_late = (ours & (rank < 0.15)) | (~ours & (rank > 0.85))
    wrong = {
        "anywhere": chance < 0.1,
        "in the track": ours & (chance < 0.35),
        "early and late": early_or_late,
    }
    factor = table.sequence.map({"a": 1.0, "b": 0.8, "c": 0.6}).where(ours, 0.8)
    return table.assign(found=~wrong[kind], factor=factor)


@pytest.mark.parametrize("factors", [False, True])
@pytest.mark.parametrize("kind", ["in the track", "early and late"])
def test_a_ratio_that_rests_on_wrong_answers_says_so_first(kind: str, factors: bool) -> None:
    table = wrong_answers(kind)
    found = evenlight.analyze(table if factors else table.drop(columns="factor"))
    right = np.exp(mixed_model(table[table.found])[0])
    assert f", of right answers alone {right:.2f} (" in found.lead
    assert "it rests on how wrong answers count." in found.lead
    assert ("With 10 % more light" in found.lead) == factors
    assert len(found.lead.split()) <= 60
    assert found.key_figures[0].value.endswith(f" or {right:.2f}")
    assert "It rests on how wrong answers count" in " ".join(found.sections[1].paragraphs)


def test_a_ratio_that_does_not_rest_on_wrong_answers_stands_alone() -> None:
    found = evenlight.analyze(wrong_answers("anywhere"))
    assert "right answers" not in found.lead + found.key_figures[0].in_words


def test_a_table_may_say_correct_in_place_of_found() -> None:
    table = lab_table(3).rename(columns={"found": "correct"})
    table.loc[:9, "correct"] = False
    words = "0 of 216 searches found nothing, 10 ended with a wrong answer."
    assert evenlight.analyze(table.assign(correct=table.correct.astype(int))).lead.endswith(words)


@pytest.mark.parametrize(("longest", "found", "lost"), [(15.0, False, 1), (40.0, True, 0)])
def test_without_a_limit_the_longest_search_tells_it(longest: float, found: bool, lost: int) -> None:
    table = lab_table(3).drop(columns="time_limit_s")
    table.loc[0, ["search_time_s", "found"]] = longest, found
    assert evenlight.analyze(table).lead.endswith(f" {lost} of 216 searches found nothing.")


def test_pairs_are_of_the_same_repetition() -> None:
    table = repeated(most=12)
    pairs = matched_pairs(table)
    counts = [
        min(np.count_nonzero(table.ours[own]), np.count_nonzero(~table.ours[own]))
        for p in range(12) for k in range(6) for own in [(table.participant == p) & (table.location == k)]
    ]  # fmt: skip
    assert pairs.first.size == sum(counts)
    assert pairs.unpaired == table.times.size - 2 * sum(counts)


def test_one_location_is_tested_over_people() -> None:
    # People differ at each location: what its own 192 searches leave open is far less than what people do.
    table = repeated(three_way_sd=0.5, most=16, fewest=16, time_limit=1e6, wrong=0.0)
    over_people, of_these = (effects_by_location(table, over) for over in (True, False))
    for k, effect in over_people.items():
        assert effect.df == 11
        own = table.some(table.location == k)
        means = pd.Series(np.log(own.times)).groupby([own.participant, own.ours]).mean().unstack()
        expected = float((means[True] - means[False]).sem())
        assert effect.standard_error == pytest.approx(expected, rel=0.05)
        assert effect.standard_error > 1.5 * (of_these[k].standard_error or 0.0)


def test_a_location_s_shares_are_compared_over_people() -> None:
    study = results(repeated())
    row = study.rows.find("locations", study.table.locations[0].name, "rings found, ours - baseline")
    own = matched_pairs(study.table)
    change = detection_change(own.at(own.location == 0))
    assert row is not None
    assert (row.value, row.ci_low, row.p_value) == (change.value, change.ci_low, change.p_value)


def test_people_with_many_searches_do_not_make_many_people() -> None:
    groups = np.repeat([0, 1, 2], [2, 2, 100])
    design = np.column_stack([np.ones(104), np.tile([0.0, 1.0], 52)])
    reference = people_reference(design, 1, groups)
    assert reference.units == round(104**2 / (2**2 + 2**2 + 100**2), 1)
    assert reference.df < 1  # neither test nor interval


def test_the_sandwich_s_mean_and_degrees_of_freedom_are_those_of_the_fitted_model() -> None:
    rng = np.random.default_rng(2)
    groups = np.repeat(np.arange(4), [4, 8, 8, 40])
    design = np.column_stack([np.ones(60), np.tile([0.0, 1.0], 30)])
    random = design @ np.array([[0.9, 0.0], [0.3, 0.6]])
    shape = (20_000, 4, 2)  # of everybody's own intercept and slope, which least squares give
    own = rng.standard_normal(shape) @ np.array([[0.9, 0.3], [0.0, 0.6]])
    inverse = [np.linalg.inv(x.T @ x) for x in (design[groups == person] for person in range(4))]
    own += np.stack([rng.multivariate_normal([0, 0], noise, shape[0]) for noise in inverse], axis=1)
    loadings = np.array([[0.9, 0.0], [0.3, 0.6]])
    information = np.stack([np.linalg.inv(loadings @ loadings.T + noise) for noise in inverse])
    influence = np.linalg.inv(information.sum(axis=0))
    means = np.einsum("ij,pjk,npk->ni", influence, information, own)
    scores = np.einsum("j,pjk,npk->np", influence[1], information, own - means[:, None])
    variances = (scores**2).sum(axis=1)
    reference = people_reference(design, 1, groups, random)
    assert reference.units is not None
    assert variances.mean() / influence[1, 1] == pytest.approx(1 - 1 / reference.units, rel=0.03)
    assert reference.df == pytest.approx(2 * variances.mean() ** 2 / variances.var(), rel=0.1)
    assert reference.units > 1.3 * (people_reference(design, 1, groups).units or 0.0)


def test_one_person_with_many_searches_does_not_widen_the_interval() -> None:
    table = lab_table(60)
    cell = ["participant_id", "sequence", "version"]
    table = table[(table.participant_id == "S00") | (table.groupby(cell).cumcount() < 6)]
    estimate, error = mixed_model(table)
    ratio = next(row for row in evenlight.analyze(table).rows if (row.group, row.what) == ("all", RATIO))
    half = stats.t.ppf(0.975, 11) * error
    assert ratio.value == pytest.approx(np.exp(estimate), abs=0.005)
    assert np.log([ratio.ci_low, ratio.ci_high]) == pytest.approx(
        [estimate - half, estimate + half], abs=0.02
    )


def test_a_curve_over_people_has_the_error_of_their_shares() -> None:
    rng = np.random.default_rng(3)
    people = np.repeat(np.arange(12), 40)
    times = np.exp(0.5 * rng.standard_normal(12)[people] + 0.2 * rng.standard_normal(480))
    curve = kaplan_meier(times, np.ones(480, bool), people)
    k = int(np.argmin(np.abs(curve.survival - 0.5)))
    shares = np.array([(times[people == p] > curve.times[k]).mean() for p in range(12)])
    half = stats.t.ppf(0.975, 11) * stats.sem(shares) / (0.5 * np.log(2))
    assert curve.low[k] == pytest.approx(0.5 ** np.exp(half), abs=0.01)
    assert curve.high[k] == pytest.approx(0.5 ** np.exp(-half), abs=0.01)
    alone = kaplan_meier(times, np.ones(480, bool))  # as if all 480 were of different people
    assert alone.high[k] - alone.low[k] < 0.4 * (curve.high[k] - curve.low[k])


def test_figures_of_repeated_short_searches_can_be_read(require_legible) -> None:
    study = results(repeated(most=16, fewest=16, middle=0.5, time_limit=20.0))
    drawn = times_figure(study), curves_figure(study)
    for drawing in drawn:
        assert drawing is not None
        require_legible(drawing.figure, PAGE)
        assert drawing.figure.axes[0].get_xlim()[1] < 5.0  # not the limit of 20 s
    assert "the first in the other are a pair" in " ".join(pairs_section(study).methods)


@pytest.mark.parametrize("known", [False, True])
def test_the_figure_of_times_has_brightness_factors_where_they_are_known(known: bool) -> None:
    table = wrong_answers("anywhere")
    drawing = evenlight.analyze(table if known else table.drop(columns="factor")).drawings[0]
    words = [text.get_text() for text in drawing.figure.findobj(Text)]
    assert ("brightness factor" in words) == ("0.60" in words) == known
    assert any("brightens most" in own for own in words) == ("brightness" in drawing.caption) == known
    assert "–" not in words


@pytest.mark.slow
def test_the_tests_of_repeated_searches_keep_their_level() -> None:
    runs, truth = 60, dataclasses.replace(DIFFERENT, fewest=4, most=4, three_way_sd=0.3)
    most = float(stats.binom.ppf(0.999, runs, 0.05)) / runs
    for rejected, held in study(truth, (VERSIONS, PLACE), runs).values():
        assert rejected <= most
        assert held >= 1 - most
