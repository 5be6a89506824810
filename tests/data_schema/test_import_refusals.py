"""What would count twice, or as a person, is refused by import."""

import json

import pytest

HEADER = "participant,trial_index,sequence,version,rating,response_time_s\n"
ROWS = "a,1,gym,ours,4,2.5\na,2,gym,baseline,3,3.25\na,3,hall,ours,5,1.5\na,4,hall,baseline,2,1.75\n"


@pytest.fixture
def rated(tmp_path, command):
    def run(text: str, *options: str):
        (tmp_path / "table.csv").write_text(text)
        return command(
            "import", tmp_path / "table.csv", "--task", "rating", "--out", tmp_path / "lab", *options
        )

    return run


def trials(tmp_path, who="a"):
    text = (tmp_path / "lab" / f"sub-{who}" / "ses-01" / "trials.jsonl").read_text()
    return [json.loads(line) for line in text.splitlines()]


def test_a_row_copied_under_a_new_index_is_refused_with_both_lines(rated, tmp_path) -> None:
    outcome = rated(HEADER + ROWS + "a,5,gym,ours,4,2.5\n")
    assert outcome.code == 2
    assert "line 6: " in outcome.err
    assert "as in line 2; a copy?" in outcome.err
    assert not (tmp_path / "lab").exists()


def test_a_further_answer_is_numbered_only_where_most_was_answered_several_times(rated, tmp_path) -> None:
    assert rated(HEADER + ROWS + "a,5,gym,ours,3,9.5\n").code == 0
    assert [trial["repetition"] for trial in trials(tmp_path)] == [1, 1, 1, 1, 1]
    assert [trial["place_in_pair"] for trial in trials(tmp_path)] == [1, 2, 1, 2, 1]


def test_a_participant_copied_under_another_name_is_refused(rated, tmp_path) -> None:
    outcome = rated(HEADER + ROWS + ROWS.replace("a,", "b,"))
    assert outcome.code == 2
    assert "participant b, session 01: its trials are those of sub-a/ses-01" in outcome.err
    assert not (tmp_path / "lab").exists()


def test_simulated_rows_stay_simulated_and_do_not_mix(rated, tmp_path) -> None:
    lines = (HEADER + ROWS).splitlines()
    said = [f"{line},{'simulated' if n == 0 else 'true'}" for n, line in enumerate(lines)]
    mixed = rated("\n".join([*said[:-1], said[-1].replace("true", "false")]) + "\n")
    assert mixed.code == 2
    assert "not simulated, but others are" in mixed.err
    outcome = rated("\n".join(said) + "\n")
    assert outcome.code == 0, outcome.err
    assert "simulated: all rows say so" in outcome.out
    assert all(trial["simulated"] for trial in trials(tmp_path))


def test_a_wide_column_of_an_unknown_version_is_refused(rated) -> None:
    text = "participant,gym_TBM,gym_const\na,4,3\n"
    options = ("--wide", "rating={sequence}_{version}", "--value", "version:ours=TBM")
    outcome = rated(text, *options)
    assert outcome.code == 2
    assert "the column 'gym_const'" in outcome.err
    assert "--value version:baseline=const" in outcome.err
    assert rated(text, *options, "--value", "version:baseline=const").code == 0


@pytest.mark.parametrize("name", ["1990-01-01", "Anna Meier"])
def test_an_identifier_like_a_name_or_a_date_is_refused(rated, name) -> None:
    outcome = rated(HEADER + ROWS.replace("a,", f"{name},"))
    assert outcome.code == 2
    assert "looks like a name or a date" in outcome.err


def test_no_file_name_is_in_the_data_set(tmp_path, command) -> None:
    (tmp_path / "Anna_Meier.csv").write_text(HEADER + ROWS)
    out = tmp_path / "lab"
    assert command("import", tmp_path / "Anna_Meier.csv", "--task", "rating", "--out", out).code == 0
    assert not [path for path in out.rglob("*") if path.is_file() and "Anna" in path.read_text()]


def test_a_block_of_ramps_that_comes_again_is_refused(tmp_path, command) -> None:
    header = "participant,trial_index,factor,rate_cd_per_m2_per_s,duration_s,response\n"
    shown = [(0.5 + 0.05 * (n % 4), 1 + n, "yes" if n % 3 else "no") for n in range(10)]
    lines = [f"a,{n},{shown[n % 10][0]:g},{shown[n % 10][1]},5,{shown[n % 10][2]}\n" for n in range(20)]
    (tmp_path / "ramps.csv").write_text(header + "".join(lines))
    rate = ("--column", "rate=rate_cd_per_m2_per_s", "--unit", "rate=cd/m^2/s")
    outcome = command(
        "import", tmp_path / "ramps.csv", "--task", "ramp", "--display", "varjo-xr3", *rate,
        "--out", tmp_path / "lab",
    )  # fmt: skip
    assert outcome.code == 2
    assert "lines 12 to 21 are 2 to 11 again" in outcome.err
