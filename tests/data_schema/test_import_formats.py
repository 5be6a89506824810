"""Every format of other programs' tables with the trials of every task; what a table may lack."""

import json
import shutil
import zipfile

import pytest
from foreign_files import FORMATS, TITLE
from foreign_tables import refusal

RATED = [
    ["participant", "sequence", "version", "rating", "response_time_s"],
    ["VP1", "Küche", "ours", 4, 2.5],
    ["VP1", "Küche", "baseline", 3, 3.25],
    ["VP2", "Küche", "ours", 5, 1.5],
]
COMPARED = [
    ["participant", "sequence", "ours_interval", "response"],
    ["VP1", "Küche", 1, "first"],
    ["VP1", "Bad", 2, "first"],
]
SEARCHED = [
    ["participant", "sequence", "keypoint", "version", "found", "search_time_s", "time_limit_s"],
    ["VP1", "Küche", "Herd", "ours", "true", 2.5, 30],
    ["VP1", "Küche", "Herd", "baseline", "false", 30, 30],
]
RAMPED = [
    ["participant", "factor", "rate_cd_m2_s", "duration_s", "response", "raum"],
    ["VP1", 0.5, 2, 5, "yes", "Küche"],
    ["VP1", 0.5, 0.25, 5, "no", "Küche"],
]
TABLES = {"rating": RATED, "comparison": COMPARED, "search": SEARCHED, "ramp": RAMPED}
KEYS = {"participant": "participant_id"}
DISPLAY = {"ramp": ("--display", "varjo-xr3")}


@pytest.fixture
def imported(tmp_path, command):
    """Import a file that a format's writer writes; the outcome, and the trials."""

    def run(kind, table, task, *options):
        shutil.rmtree(tmp_path / "lab", ignore_errors=True)
        path = tmp_path / kind
        FORMATS[kind](path, table)
        command_line = (
            "import",
            path,
            "--task",
            task,
            "--out",
            tmp_path / "lab",
            *DISPLAY.get(task, ()),
            *options,
        )
        outcome = command(*command_line)
        files = sorted((tmp_path / "lab").glob("sub-*/ses-*/trials.jsonl"))
        return outcome, [json.loads(line) for file in files for line in file.read_text("utf-8").splitlines()]

    return run


@pytest.mark.parametrize("task", TABLES)
@pytest.mark.parametrize("kind", FORMATS)
def test_every_format_holds_the_trials_of_every_task(imported, tmp_path, kind, task) -> None:
    names, *rows = TABLES[task]
    outcome, trials = imported(kind, TABLES[task], task)
    assert outcome.code == 0, outcome.err
    told = [
        [trial[KEYS.get(name, name)] for name in names if KEYS.get(name, name) in trial] for trial in trials
    ]
    known = [n for n, name in enumerate(names) if KEYS.get(name, name) in trials[0]]
    assert told == [[{"true": True, "false": False}.get(row[n], row[n]) for n in known] for row in rows]
    encoding = {"German Excel.csv": "cp1252", "UTF-32.csv": "utf-32", "E-Prime.txt": "utf-16"}.get(kind)
    if encoding:
        assert f"read as {encoding}" in outcome.out
    if kind.endswith(".xlsx"):
        assert "workbook, sheet 'Data'" in outcome.out
    if kind in ("SPSS.sav", "Stata.dta"):
        assert f"title: {TITLE}" in outcome.out
        assert json.loads((tmp_path / "lab/dataset_description.json").read_text())["Name"] == TITLE


@pytest.mark.parametrize("kind", ["Excel.xlsx", "German Excel.csv", "E-Prime.txt", "arrays.json"])
def test_a_table_without_a_header_is_named_by_an_option(imported, tmp_path, kind) -> None:
    table = [["VP1", 1, "gym", 1, 4], ["VP1", 2, "gym", 2, 3], ["VP1", 3, "bath", 1, 5]]
    outcome, _ = imported(kind, table, "rating")
    assert "if these are data, name the columns with --names A,B,C" in refusal(outcome, tmp_path)
    names = ("--names", "participant,trial_index,sequence,version,rating")
    values = ("--value", "version:ours=1", "--value", "version:baseline=2")
    outcome, trials = imported(kind, table, "rating", *names, *values)
    assert outcome.code == 0, outcome.err
    assert [trial["rating"] for trial in trials] == [4, 3, 5]
    if kind == "Excel.xlsx":
        outcome, _ = imported(kind, table, "rating", *names, "--sheet", "Daten")
        assert refusal(outcome, tmp_path) == "Excel.xlsx: no sheet 'Daten'; its sheets are Notes, Data"
    outcome, _ = imported(kind, table, "rating", "--names", "participant,rating")
    assert "expected 2 cells, got 5; --names has a name for each" in outcome.err


def test_names_of_a_wide_table_may_be_numbers(imported) -> None:
    table = [["participant", "1", "2"], ["VP1", 4, 3]]
    options = ("--wide", "rating={sequence}", "--constant", "version=ours")
    outcome, trials = imported("table.tsv", table, "rating", *options)
    assert outcome.code == 0, outcome.err
    assert [(trial["sequence"], trial["rating"]) for trial in trials] == [("1", 4), ("2", 3)]


def test_the_name_of_the_file_tells_the_participant(imported, tmp_path, command) -> None:
    table = [row[1:] for row in RATED[:3]]
    for who in ("17", "018"):
        FORMATS["table.tsv"](tmp_path / f"rating_{who}_day.tsv", table)
    files = sorted(tmp_path.glob("rating_*"))
    line = ("import", *files, "--task", "rating", "--out", tmp_path / "lab", "--participant-from")
    assert command(*line, r"_(\d+)_").code == 0
    assert {path.name for path in (tmp_path / "lab").glob("sub-*")} == {"sub-17", "sub-018"}
    shutil.rmtree(tmp_path / "lab")
    assert "rating_018_day.tsv: --participant-from (x) finds nothing in its name" in command(*line, "(x)").err
    for wrong in ("x", "(", "(a)(b)"):
        assert "expected a regular expression with one group" in refusal(command(*line, wrong), tmp_path)


COUNTED = [["participant", "initial_luminance_cd_m2", "rate_cd_m2_s", "duration_s", "k", "n"],
           ["VP1", 50, 0.5, 5, 2, 10], ["VP1", 50, 2, 5, 9, 10]]  # fmt: skip


def test_counts_are_that_many_trials_in_an_unknown_order(imported, tmp_path) -> None:
    outcome, _ = imported("table.tsv", COUNTED, "ramp")
    assert "'k' yes (--column n_yes=k), or right ones of two intervals" in refusal(outcome, tmp_path)
    outcome, trials = imported("table.tsv", COUNTED, "ramp", "--column", "n_yes=k")
    assert outcome.code == 0, outcome.err
    yes = [sum(t["response"] == "yes" for t in trials if t["rate_cd_m2_s"] == rate) for rate in (0.5, 2.0)]
    assert (len(trials), yes) == (20, [2, 9])
    assert "trial_index: the order of rows" in outcome.out
    table = [["participant", "sequence", "n_ours", "n_trials"], ["VP1", "gym", 7, 8]]
    outcome, trials = imported("table.tsv", table, "comparison")
    assert outcome.code == 0, outcome.err
    assert [trial["chosen"] for trial in trials] == ["ours"] * 7 + ["baseline"]
    assert [trial["repetition"] for trial in trials] == list(range(1, 9))
    two = [[*row, interval] for row, interval in zip(COUNTED, ("ramp_interval", 1, 2), strict=True)]
    for table, name in ((two, "n_yes"), (COUNTED, "n_correct")):
        outcome, _ = imported("table.tsv", table, "ramp", "--column", f"{name}=k")
        assert "give a row for each trial" in refusal(outcome, tmp_path)
    wrong = [*COUNTED[:2], ["VP1", 50, 2, 5, 11, 10]]
    outcome, _ = imported("table.tsv", wrong, "ramp", "--column", "n_yes=k")
    assert "expected n_yes of n_trials, got 11 of 10" in refusal(outcome, tmp_path)


def test_what_stands_for_no_value_is_told(imported) -> None:
    rated = [[*row[:3], 999 if n else ".", row[4]] for n, row in enumerate(RATED[1:])]
    table = [RATED[0], *rated, ["VP3", "Küche", "ours", 999.0, "-"], ["VP3", "Küche", "baseline", 2, "-"]]
    outcome, trials = imported(
        "table.tsv", table, "rating", "--missing", "999", "--missing", ".", "--missing", "-"
    )
    assert outcome.code == 0, outcome.err
    assert [(trial["rating"], trial["response_time_s"]) for trial in trials] == [(2, None)]


def many(*bad):
    rows = [[f"VP{n}", "gym", "ours", 1 + n % 5, 1.5 + n] for n in range(60)]
    for n, value in enumerate(bad):
        rows[10 * n][3] = value
    return [RATED[0], *rows]


def test_a_few_impossible_values_are_left_out_and_many_are_refused(imported, tmp_path) -> None:
    outcome, trials = imported("table.tsv", many(77, "gut", -1), "rating", "--scale", "1..5")
    assert outcome.code == 0, outcome.err
    assert len(trials) == 57
    assert "left out 3 of 60 rows, as their values are impossible:\n  line 2, column 'rating'" in outcome.out
    assert "\n  line 12, column 'rating': expected a number, got 'gut'\n  line 22" in outcome.out
    outcome, _ = imported("table.tsv", many(77, 77, 77, 77), "rating", "--scale", "1..5")
    assert "line 2, column 'rating': rating must be" in refusal(outcome, tmp_path)
    assert "(and 3 other rows)" in outcome.err


def test_a_wide_table_is_told_of_the_option(imported) -> None:
    table = [["participant", "gym_TBM", "gym_const", "hall_TBM", "hall_const"], ["VP1", 4, 3, 5, 2]]
    outcome, _ = imported("table.tsv", table, "rating")
    assert (
        "if each answer has a column, as of TBM and const, give --wide rating={sequence}_{version}"
        in outcome.err
    )


def test_labels_of_values_are_their_words_and_numbers_stay(tmp_path, command) -> None:
    """SPSS: 1 is labelled "ours"; a rating labelled at its ends is its number; 9 is missing by the user."""
    import pandas as pd
    import pyreadstat

    frame = pd.DataFrame(
        {"vp": ["S1"] * 3, "scene": [1.0, 1.0, 2.0], "version": [1.0, 2.0, 1.0], "rating": [5.0, 1.0, 9.0]}
    )
    labels = {
        "version": {1: "ours", 2: "baseline"},
        "rating": {1: "bad", 5: "good"},
        "scene": {1: "gym", 2: "hall"},
    }
    pyreadstat.write_sav(
        frame, tmp_path / "a.sav", variable_value_labels=labels, missing_ranges={"rating": [9]}
    )
    told = ("--column", "participant_id=vp", "--column", "sequence=scene")
    outcome = command("import", tmp_path / "a.sav", "--task", "rating", "--out", tmp_path / "lab", *told)
    assert outcome.code == 0, outcome.err
    lines = (tmp_path / "lab/sub-S1/ses-01/trials.jsonl").read_text().splitlines()
    found = [(t["sequence"], t["version"], t["rating"]) for t in map(json.loads, lines)]
    assert found == [("gym", "ours", 5), ("gym", "baseline", 1)]
    assert "skipped 1 row without a rating (row 3)" in outcome.out


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("picture.png", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "picture.png: is not text"),
        ("a.csv", "participant,ünit\n".encode("utf-16")[:-1], "a.csv: is not text"),
        ("a.xlsx", b"PK\x03\x04 torn", "a.xlsx: cannot be read as a workbook"),
        ("a.sav", b"$FL2 torn", "a.sav: cannot be read as SPSS"),
        ("a.json", b'{"a": [1, 2], "b": [1]}', "a.json: expected a list of trials, or columns of"),
    ],
)  # fmt: skip
def test_what_is_no_table_is_refused_in_one_line(tmp_path, command, name, content, words) -> None:
    (tmp_path / name).write_bytes(content)
    line = ("import", tmp_path / name, "--task", "rating", "--out", tmp_path / "lab")
    assert refusal(command(*line), tmp_path).startswith(words)
    if name == "a.csv":
        assert "expected an encoding" in command(*line, "--encoding", "klingon").err
        assert "is not text in ascii" in command(*line, "--encoding", "ascii").err
    with zipfile.ZipFile(tmp_path / "other.zip", "w") as archive:
        archive.writestr("a.txt", "text")
    assert "cannot be read as a workbook" in command("import", tmp_path / "other.zip", *line[2:]).err


@pytest.mark.parametrize("kind", ["Excel.xlsx", "SPSS.sav"])
def test_without_its_library_a_format_is_refused_with_the_extra(
    imported, monkeypatch, tmp_path, kind
) -> None:
    import sys

    FORMATS[kind](tmp_path / "there", RATED)
    module = "python_calamine" if kind == "Excel.xlsx" else "pyreadstat"
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setitem(FORMATS, kind, lambda path, _: shutil.copy(tmp_path / "there", path))
    outcome, _ = imported(kind, RATED, "rating")
    assert "needs an extra: pip install 'evenlight[tables]'" in refusal(outcome, tmp_path)


def test_settings_of_a_mapping_are_the_options(imported, tmp_path) -> None:
    (tmp_path / "how.toml").write_text(
        'names = ["participant", "sequence", "version", "rating", "rt"]\n'
        'missing = ["-", 99]\nencoding = "latin-1"\n'
    )
    outcome, trials = imported(
        "table.tsv", [*RATED[1:], ["VP9", "a", "ours", 99, "-"]], "rating", "--mapping", tmp_path / "how.toml"
    )
    assert outcome.code == 0, outcome.err
    assert "read as latin-1" in outcome.out
    assert len(trials) == 3
