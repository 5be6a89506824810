"""Hard cases of the artifact comparison: each is answered with a flag in words, or refused."""

from __future__ import annotations

import pytest
from comparison_answers import answers_of, data_of, row, rows_of
from scipy import stats

from evenlight.analysis.comparison.comparison_findings import (
    comparison_findings,
    key_figures_of,
    lead_of,
    pooled_section,
    warnings_of,
)
from evenlight.analysis.comparison.comparison_results import add_limits, compare
from evenlight.analysis.dataset_findings import AnalysisOptions, task_findings
from evenlight.analysis.rows import Rows
from evenlight.analysis.session_loading import TaskData
from evenlight.data_schema.analysis_results import Origin
from evenlight.data_schema.errors import InputError


def limits_of(n: int) -> tuple[Rows, dict[str, float | None]]:
    rows = Rows(Origin.COMPUTED)
    return rows, add_limits(rows, n, 0.15)


class TestHardCases:
    @pytest.mark.parametrize("ours", [True, False])
    def test_everybody_gives_the_same_answer(self, ours: bool) -> None:
        rows = rows_of(answers_of(lambda who, s: ours))
        share = row(rows, "shares", "gym", "ours chosen")
        assert (share.value, share.p_value) == (float(ours), 2 / 2**17)
        pooled = row(rows, "shares", "all", "ours chosen")
        assert "every answer was the same" in pooled.flag
        assert pooled.ci_low is not None
        assert pooled.ci_high is not None
        # An interval with people as the sample: (1 - width)^17 = 2.5 %.
        assert pooled.ci_high - pooled.ci_low == pytest.approx(1 - 0.025 ** (1 / 17), abs=1e-9)
        model = row(rows, "model", "all", "ours chosen")
        assert (model.value, model.p_value) == (None, None)
        assert model.flag

    def test_a_leaning_without_bound_is_a_warning(self) -> None:
        found = compare(data_of(answers_of(lambda who, s: (who + s) % 2 == 0)), 1, 0.15)  # always "first"
        (said,) = warnings_of(found)
        assert said.startswith("first chosen by a person in the middle: runs to plus infinity")

    def test_one_participant(self) -> None:
        rows = rows_of(answers_of(lambda who, s: s < 3, people=1))
        for share in (s for s in rows if s.what == "ours chosen"):
            assert "one participant" in share.flag
            assert share.p_value == 1.0
        assert row(rows, "equivalence", "all", "smallest margin").value is None

    def test_a_participant_with_one_answer_and_sequences_with_gaps(self) -> None:
        every = answers_of(lambda who, s: (who + s + who // 4) % 2 == 0)
        found = compare(data_of([a for a in every if a[0] != "03" or a[1] == "gym"]), 1, 0.15)
        assert row(found.rows, "shares", "library", "ours chosen").n == 16
        said = "comparison of library: no answer of 1 of 17 participants (03)"
        assert said in warnings_of(found)
        assert found.answers_per_sequence == [16, 16, 16, 17]

    def test_a_sequence_that_nobody_compared_has_a_flag_in_place_of_a_number(self) -> None:
        every = answers_of(lambda who, s: (who + s + who // 4) % 2 == 0)
        (share,) = (s for s in rows_of([a for a in every if a[1] != "gym"]) if s.group == "gym")
        assert (share.value, share.flag, share.n) == (None, "nobody compared it", 0)

    def test_ours_always_first_leaves_no_leaning_to_estimate_and_does_not_fail(self) -> None:
        every = answers_of(lambda who, s: (who + s) % 3 == 0)
        rows = rows_of([(who, name, ours, 1) for who, name, ours, _ in every])
        leaning = row(rows, "model", "all", "first chosen")
        assert leaning.value is None
        assert row(rows, "model", "all", "ours chosen").value is not None
        shares = [s for s in rows if s.table in ("shares", "equivalence") or s.what == leaning.what]
        assert {s.table for s in shares} >= {"shares", "equivalence"}
        assert all("cannot be told from a leaning" in s.flag for s in shares)
        assert "cannot be told" in row(rows, "model", "all", "ours chosen").flag

    def test_ours_nearly_always_second_in_one_sequence_is_warned_of_there_and_only_there(self) -> None:
        every = answers_of(lambda who, s: (who + s + who // 4) % 2 == 0)
        uneven = [(w, name, ours, 1 if w == "03" else 2) if name == "living_room" else (w, name, ours, k)
                  for w, name, ours, k in every]  # fmt: skip
        found = compare(data_of(uneven), 1, 0.15)
        (said,) = [words for words in warnings_of(found) if "leaning" in words]
        assert said.startswith("comparison of living room: the track came second in 16 of 17 trials")
        flagged = {s.group for s in found.rows if "can hardly be told" in s.flag}
        assert flagged == {"living_room"}

    @pytest.mark.slow
    def test_ours_always_first_is_said_in_the_lead_and_no_model_tells_it_from_a_leaning(self) -> None:
        every = answers_of(lambda who, s: (who + s + who // 4) % 2 == 0)
        data = data_of([(w, name, ours, 1) for w, name, ours, _ in every])
        found = compare(data, 1, 0.15)
        lead = task_findings(data, AnalysisOptions()).lead
        assert lead.startswith(
            "Caution: in the comparisons the track was shown first in all 68 pairs, so order"
        )
        assert "excluded" not in lead
        assert "differ" not in lead
        cards = key_figures_of(found, limits_of(17)[1])
        assert any("cannot be told from a leaning" in card.in_words for card in cards)
        assert "nor does the model" in pooled_section(found).paragraphs[0]
        assert "sets apart" not in pooled_section(found).paragraphs[0]

    def test_sequences_that_contradict_each_other_have_no_common_share(self) -> None:
        """Two sequences nobody's but for one answer, two everybody's: 35 of 68, and people hardly differ."""
        found = compare(data_of(answers_of(lambda who, s: s % 2 == 1 or (who == 0 and s == 0))), 1, 0.15)
        assert found.contradictory
        assert "is excluded" not in lead_of(found, limits_of(17)[1])
        pooled = row(found.rows, "shares", "all", "ours chosen")
        assert pooled.ci_low is not None
        assert pooled.ci_high is not None
        # No shorter than 68 independent answers give.
        exact = stats.binomtest(35, 68).proportion_ci()
        assert (pooled.ci_low, pooled.ci_high) == pytest.approx((exact.low, exact.high))
        assert "the sequences differ" in pooled.flag

    def test_people_who_always_give_their_own_answer_have_no_number_of_the_model(self) -> None:
        found = compare(data_of(answers_of(lambda who, s: who % 2 == 0)), 1, 0.15)
        for own in (s for s in found.rows if s.table == "model"):
            assert (own.value, own.ci_low, own.ci_high, own.p_value) == (None,) * 4
            assert "did not converge" in own.flag
        assert "gives no number" in pooled_section(found).paragraphs[0]

    def test_clustered_rows_count_people(self) -> None:
        rows = rows_of(answers_of(lambda who, s: (who + s + who // 4) % 2 == 0))
        assert {s.n for s in rows if s.group == "all"} == {17}
        same = rows_of(answers_of(lambda who, s: True))
        assert "exact binomial" in row(same, "shares", "all", "ours chosen").method
        assert "exact binomial" in row(same, "equivalence", "all", "share within").method

    def test_participants_who_all_have_the_same_share_have_the_interval_of_independent_answers(self) -> None:
        rows = rows_of(answers_of(lambda who, s: s % 2 == who % 2))
        pooled = row(rows, "shares", "all", "ours chosen")
        assert pooled.value == 0.5
        exact = stats.binomtest(34, 68).proportion_ci()
        assert (pooled.ci_low, pooled.ci_high) == pytest.approx((exact.low, exact.high))
        margin = row(rows, "equivalence", "all", "smallest margin").value
        assert margin == pytest.approx(stats.t.ppf(0.95, 16) * (0.25 / 68) ** 0.5)

    def test_no_answer_at_all_is_refused(self) -> None:
        with pytest.raises(InputError, match="no comparison counts"):
            comparison_findings(TaskData("comparison", (), True, "0" * 64, ()))

    @pytest.mark.slow
    @pytest.mark.parametrize("n", [1, 2, 5, 200])
    def test_the_limits_of_any_number_of_answers_are_numbers_or_flags(self, n: int) -> None:
        rows = limits_of(n)[0]
        assert all((s.value is None) == bool(s.flag) for s in rows)
        assert row(rows, "limits", f"{n} answers", "type I error").value == pytest.approx(
            sum(stats.binom.pmf(k, n, 0.5) for k in range(n + 1) if stats.binomtest(k, n).pvalue <= 0.05)
        )

    def test_two_people(self) -> None:
        rows = rows_of(answers_of(lambda who, s: (who + s) % 3 == 0, people=2))
        assert row(rows, "shares", "all", "ours chosen").p_value == 1.0
        assert row(limits_of(2)[0], "limits", "2 answers", "smallest share").flag
