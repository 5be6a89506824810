"""A table of ratings that somebody typed goes in and comes out as a report, by two commands."""

import csv
import io
from fractions import Fraction
from pathlib import Path

import pytest

from evenlight.data_schema.analysis_results import AnalysisSummary, Statistic
from evenlight.data_schema.recordings.session import SessionManifest, SessionStatus
from evenlight.data_schema.storage.tables import read_rows
from evenlight.data_schema.storage.text_files import read_json_record

PEOPLE = 17
# Table 1 of the paper: the means of 17 ratings of the baseline and of ours.
PRINTED = {
    "library": (3.59, 3.76),
    "gym": (3.23, 3.71),
    "living_room": (3.82, 4.18),
    "basement": (3.47, 4.29),
}
# The sums of 17 whole ratings whose means come nearest: 17 x 3.59 = 61.03 is 61, and so on.
SUMS = {"library": (61, 64), "gym": (55, 63), "living_room": (65, 71), "basement": (59, 73)}


def ratings_of(total: int) -> list[int]:
    """17 ratings of 1 to 5 with a sum: as many of one rating, and of the next one, as it takes."""
    low, more = divmod(total, PEOPLE)
    return [low + 1] * more + [low] * (PEOPLE - more)


def typed_ratings() -> dict[tuple[str, str], list[int]]:
    return {
        (sequence, version): ratings_of(total)
        for sequence, sums in SUMS.items()
        for version, total in zip(("baseline", "ours"), sums, strict=True)
    }


@pytest.fixture(scope="module")
def long_table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("typed") / "ratings.csv"
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(["Participant", "sequence", "version", "rating"])
        for (sequence, version), given in typed_ratings().items():
            writer.writerows([f"P{who + 1:02d}", sequence, version, given[who]] for who in range(PEOPLE))
    return path


def test_the_sums_are_those_nearest_to_the_printed_means() -> None:
    for sequence, means in PRINTED.items():
        assert [round(PEOPLE * mean) for mean in means] == list(SUMS[sequence])


def test_two_commands_make_a_report_of_typed_ratings(long_table, tmp_path, command, blank_pictures) -> None:
    made = command("import", long_table, "--task", "rating", "--out", tmp_path / "lab")
    assert made.code == 0, made.err
    assert "participant_id: 'Participant'" in made.out
    assert "unknown: display, design, place_in_pair, mean_factor, response_time_s" in made.out
    assert "17 participants, 17 sessions, 136 trials" in made.out
    analyzed = command("analyze", tmp_path / "lab", "--out", tmp_path / "report")
    assert analyzed.code == 0, analyzed.err
    assert "rated 0.46 points higher" in (tmp_path / "report/report.html").read_text()

    rows = read_rows(Statistic, tmp_path / "report/rating_statistics.csv")
    value = {(row.group, row.what): row.value for row in rows}
    for sequence, (baseline, ours) in SUMS.items():
        assert value[sequence, "mean rating, baseline"] == pytest.approx(baseline / 17, abs=1e-12)
        assert value[sequence, "mean rating, ours"] == pytest.approx(ours / 17, abs=1e-12)
        difference = value[sequence, "mean difference, ours less baseline"]
        assert difference == pytest.approx((ours - baseline) / 17, abs=1e-12)
    # (3 + 8 + 6 + 14) / 17 over four sequences
    overall = value["all", "mean difference, ours less baseline"]
    assert overall == pytest.approx(float(Fraction(31, 68)), abs=1e-12)

    order = {row.what: row for row in rows if row.table == "order" and row.group == "all"}
    assert {row.flag for row in order.values()} == {
        "nobody has rated both versions in an order that is known"
    }
    assert all(row.value is None and row.p_value is None for row in order.values())
    place = next(row for row in rows if row.what.endswith("shown second to first"))
    assert place.value is None
    assert place.flag == "nobody has rated both versions in an order that is known"
    assert not any("told apart" in row.flag for row in rows)
    assert read_json_record(AnalysisSummary, tmp_path / "report/analysis.json").refused == {}


def test_validate_finds_no_problem_and_the_manifest_invents_nothing(long_table, tmp_path, command) -> None:
    assert command("import", long_table, "--task", "rating", "--out", tmp_path / "lab", "--quiet").out == ""
    checked = command("validate", tmp_path / "lab")
    assert (checked.code, checked.out.splitlines()[-1]) == (0, "no problem; 71 ok, 1 not checked")
    manifest = read_json_record(SessionManifest, tmp_path / "lab/sub-P01/ses-01/manifest.json")
    assert manifest.status is SessionStatus.IMPORTED
    assert manifest.display is None
    assert manifest.design is None
    assert manifest.rig is None
    assert manifest.stimuli == ()
    assert manifest.n_trials == 8
    assert manifest.started == ""
    assert manifest.source is not None
    assert manifest.source.file == "file 1 of 1"
    assert manifest.source.columns["participant_id"] == "Participant"
    assert not manifest.order_known
    assert "imported from 1 file (CSV with commas)" in (tmp_path / "lab/README").read_text()


@pytest.mark.parametrize("standard", ["bids", "psych-ds"])
def test_it_can_be_exported(long_table, tmp_path, command, standard) -> None:
    command("import", long_table, "--task", "rating", "--out", tmp_path / "lab")
    exported = command("export", tmp_path / "lab", "--to", standard, "--out", tmp_path / "out")
    assert exported.code == 0, exported.err
    assert "17 tables" in exported.out


def test_a_wide_table_of_a_european_office_program_says_the_same(long_table, tmp_path, command) -> None:
    """One row per person, semicolons, decimal commas, a byte order mark, other names of the versions."""
    cells = typed_ratings()
    other = {"ours": "TBM", "baseline": "const"}
    stream = io.StringIO()
    writer = csv.writer(stream, delimiter=";", lineterminator="\r\n")
    writer.writerow(["VP", "Alter", *(f"{sequence}_{other[version]}" for sequence, version in cells)])
    for who in range(PEOPLE):
        writer.writerow([f"P{who + 1:02d}", "23,5", *(f"{given[who]},0" for given in cells.values())])
    wide = tmp_path / "breit.csv"
    wide.write_text("\ufeff" + stream.getvalue(), newline="")
    made = command(
        "import", wide, "--task", "rating", "--out", tmp_path / "wide", "--column", "participant_id=VP",
        "--wide", "rating={sequence}_{version}", "--value", "version:ours=TBM",
        "--value", "version:baseline=const",
    )  # fmt: skip
    assert made.code == 0, made.err
    assert "CSV with semicolons" in made.out
    assert command("validate", tmp_path / "wide", "--quiet").code == 0
    command("import", long_table, "--task", "rating", "--out", tmp_path / "long")
    for who in ("P01", "P09", "P17"):
        wide_trials, long_trials = (
            (tmp_path / name / f"sub-{who}/ses-01/trials.jsonl").read_text() for name in ("wide", "long")
        )
        assert wide_trials == long_trials
