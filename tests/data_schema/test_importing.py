"""Other programs' tables of trials: what is taken for what, what stays unknown, what is refused."""

import json
from typing import Any

import pytest
from foreign_tables import RAMP_OPTIONS, RAMPS, RATINGS, SEARCH_OPTIONS, SEARCHES, refusal

from evenlight.data_schema.analysis_results import Statistic
from evenlight.data_schema.recordings.session import SessionManifest
from evenlight.data_schema.storage.tables import read_rows
from evenlight.data_schema.storage.text_files import read_json_record

# As PsychoPy writes it: a row for each routine, a delimiter at the end of each line, None for no key.
PSYCHOPY = """\
instr.started,trials.thisRepN,trials.thisTrialN,trials.thisN,trials.thisIndex,scene,condition,slider.response,slider.rt,key_resp.keys,key_resp.rt,participant,session,date,expName,psychopyVersion,frameRate,
12.1,,,,,,,,,space,2.1,07,001,2024-05-03_10h12.01.123,detail,2023.2.3,60.0,
,0,0,0,3,living room,TBM,4,3.41,None,,07,001,2024-05-03_10h12.01.123,detail,2023.2.3,60.0,
,0,1,1,0,living room,const,3,2.87,None,,07,001,2024-05-03_10h12.01.123,detail,2023.2.3,60.0,
,0,2,2,2,gym,const,None,,None,,07,001,2024-05-03_10h12.01.123,detail,2023.2.3,60.0,
,0,3,3,1,gym,TBM,5,1.90,None,,07,001,2024-05-03_10h12.01.123,detail,2023.2.3,60.0,
,,,,,,,,,,,07,001,2024-05-03_10h12.01.123,detail,2023.2.3,60.0,
"""
# As jsPsych's data.get().json() writes it: all plugins in one list; survey-likert counts labels from 0.
JSPSYCH: list[dict[str, Any]] = [
    {"trial_type": "instructions", "trial_index": 0, "rt": 8123, "view_history": [], "subject": "a1"},
    {"trial_type": "survey-likert", "trial_index": 1, "rt": 4210, "response": {"Q0": 3}, "task": "rating",
     "scene": "gym", "version": "baseline", "subject": "a1"},
    {"trial_type": "html-keyboard-response", "trial_index": 2, "rt": None, "response": None, "subject": "a1"},
    {"trial_type": "survey-likert", "trial_index": 3, "rt": 3999, "response": {"Q0": 2}, "task": "rating",
     "scene": "gym", "version": "ours", "subject": "a1"},
    {"trial_type": "survey-likert", "trial_index": 4, "rt": 1999, "response": {"Q0": 2}, "task": "practice",
     "scene": "gym", "version": "ours", "subject": "a1"},
]  # fmt: skip
LIKERT = """\
[columns]
rating = "response.Q0"
response_time = "rt"
sequence = "scene"
[units]
response_time = "ms"
[values.rating]
1 = 0
2 = 1
3 = 2
4 = 3
5 = 4
[only]
task = "rating"
"""


PSYCHOPY_OPTIONS = (
    "--column", "rating=slider.response", "--column", "response_time=slider.rt", "--unit", "response_time=s",
    "--column", "trial_index=trials.thisN", "--column", "sequence=scene", "--column", "version=condition",
    "--value", "version:ours=TBM", "--value", "version:baseline=const",
)  # fmt: skip


def test_a_psychopy_file_gives_its_trials_and_not_its_routines(importing) -> None:
    outcome, trials = importing(PSYCHOPY, "rating", *PSYCHOPY_OPTIONS)
    told = [
        (t["sequence"], t["version"], t["rating"], t["response_time_s"], t["trial_index"]) for t in trials
    ]
    assert told == [
        ("living_room", "ours", 4, 3.41, 0),
        ("living_room", "baseline", 3, 2.87, 1),
        ("gym", "ours", 5, 1.9, 3),
    ]
    assert {(t["participant_id"], t["session_id"]) for t in trials} == {("07", "001")}
    # thisN is the order in which they were shown; of gym only one version was rated.
    assert [t["place_in_pair"] for t in trials] == [1, 2, None]
    assert "PsychoPy's CSV" in outcome.out
    assert "skipped 3 rows without a rating (lines 2, 5, 7)" in outcome.out
    assert "date" not in " ".join(trials[0])


def test_a_jspsych_file_gives_the_trials_asked_for(importing, tmp_path) -> None:
    (tmp_path / "likert.toml").write_text(LIKERT)
    outcome, trials = importing(
        json.dumps(JSPSYCH), "rating", "--mapping", str(tmp_path / "likert.toml"), name="data.json"
    )
    assert [(t["version"], t["rating"], t["response_time_s"]) for t in trials] == [
        ("baseline", 4, 4.21),
        ("ours", 3, 3.999),
    ]
    assert [t["place_in_pair"] for t in trials] == [1, 2]
    assert "jsPsych's JSON" in outcome.out
    assert "left out by --only: 3 of 5 rows" in outcome.out


def test_jspsych_as_csv_and_as_lines_of_a_server_say_the_same(importing, tmp_path, command) -> None:
    (tmp_path / "likert.toml").write_text(LIKERT)
    columns = list(dict.fromkeys(key for row in JSPSYCH for key in row))

    def cell(value: Any) -> str:
        text = "" if value is None else json.dumps(value) if isinstance(value, dict | list) else str(value)
        return '"' + text.replace('"', '""') + '"'

    table = "\n".join([",".join(columns), *(",".join(cell(row.get(k)) for k in columns) for row in JSPSYCH)])
    (tmp_path / "server.txt").write_text("\n".join([json.dumps(JSPSYCH[:2]), json.dumps(JSPSYCH[2:])]))
    _, trials = importing(table, "rating", "--mapping", str(tmp_path / "likert.toml"))
    command("import", tmp_path / "server.txt", "--task", "rating", "--mapping", tmp_path / "likert.toml",
            "--out", tmp_path / "lines")  # fmt: skip
    lines = (tmp_path / "lines/sub-a1/ses-01/trials.jsonl").read_text().splitlines()
    assert [json.loads(line) for line in lines] == trials
    assert [t["rating"] for t in trials] == [4, 3]


def test_comparisons_may_say_the_version_instead_of_the_interval(importing) -> None:
    text = "id\tscene\tpreferred\n1\tgym\tTBM\n1\tlibrary\tconst\n2\tgym\tconst\n"
    _, trials = importing(
        text, "comparison", "--column", "participant_id=id", "--column", "sequence=scene", "--column",
        "chosen=preferred", "--value", "chosen:ours=TBM", "--value", "chosen:baseline=const",
        name="table.tsv",
    )  # fmt: skip
    assert [(t["chosen"], t["ours_interval"], t["response"]) for t in trials] == [
        ("ours", None, None),
        ("baseline", None, None),
        ("baseline", None, None),
    ]


def test_a_choice_whose_interval_is_known_is_said_by_it(importing) -> None:
    text = "participant,sequence,ours_interval,chosen\na,gym,2,ours\na,library,2,baseline\n"
    _, trials = importing(text, "comparison")
    assert [(t["response"], t["chosen"]) for t in trials] == [("second", None), ("first", None)]


def test_searches_are_censored_at_the_limit_and_know_no_ring(importing) -> None:
    outcome, trials = importing(SEARCHES, "search", *SEARCH_OPTIONS)
    assert [t["search_time_s"] for t in trials] == [3.25, 30.0, 2.5, 30.0]
    assert [t["found"] for t in trials] == [True, False, True, False]
    for key in ("factor", "ring_place", "ring_orientation_deg", "reported_orientation_deg", "gap_pixels"):
        assert {t[key] for t in trials} == {None}
    assert "CSV with semicolons" in outcome.out
    assert "numbers have decimal commas" in outcome.out
    assert "time_limit_s: 30 in all rows" in outcome.out


def test_an_answer_before_the_limit_without_success_is_a_wrong_one(importing) -> None:
    outcome, trials = importing(SEARCHES.replace("nein;30", "nein;12"), "search", *SEARCH_OPTIONS)
    assert [t["search_time_s"] for t in trials] == [3.25, 2.5, 12.0]
    assert "left out 1 search without success and a time, as others ended before the limit" in outcome.out
    assert "they lasted to it (line 3)" in outcome.out
    assert "found: 1 search without success ended before the time limit, with a wrong answer" in outcome.out


def test_accuracy_tells_what_was_found_and_the_order_of_rows_which_repetition(importing) -> None:
    header = "participant,sequence,keypoint,version,accuracy,search_time_s"
    rows = [f"{who},gym,door,{version},{k % 2},{int(who) + 0.1 * k}"
            for who in "12" for k in range(3) for version in ("ours", "baseline")]  # fmt: skip
    outcome, trials = importing("\n".join([header, *rows]), "search", "--constant", "time_limit=20")
    assert [t["repetition"] for t in trials] == [1, 1, 2, 2, 3, 3] * 2
    assert [t["found"] for t in trials[:6]] == [False, False, True, True, False, False]
    assert trials[0]["search_time_s"] == 1.0
    assert "repetition: by the order of rows" in outcome.out


def test_rows_that_were_pasted_twice_are_refused(importing, tmp_path) -> None:
    header = "participant,sequence,keypoint,version,found,search_time_s"
    rows = [f"1,gym,k{k},ours,yes,{1.1 + 0.37 * k:.2f}" for k in range(12)]
    outcome, _ = importing("\n".join([header, *rows, *rows]), "search", "--constant", "time_limit=20")
    assert "lines 14 to 23 are 2 to 11 again, but for the index; a copy?" in refusal(outcome, tmp_path)


@pytest.mark.slow
def test_searches_without_brightness_or_order_are_analysed_without_them(importing, tmp_path, command) -> None:
    """Twelve people find the ring in ours in half the time that they take in the baseline."""
    rows = []
    for who in range(1, 13):
        for place in range(4):
            time = 2 + 0.1 * ((5 * who + 3 * place) % 12)
            rows += [f"{who},library,spot{place},ours,true,{time}"]
            rows += [f"{who},library,spot{place},baseline,true,{2 * time}"]
    header = "participant,sequence,keypoint,version,found,search_time_s"
    importing("\n".join([header, *rows]), "search", "--constant", "time_limit=30")
    analyzed = command("analyze", tmp_path / "lab", "--out", tmp_path / "out")
    assert analyzed.code == 0, analyzed.err
    assert "the brightness factors of the versions are unknown" in analyzed.out
    assert "about equal brightness" not in analyzed.out
    found = read_rows(Statistic, tmp_path / "out/search_statistics.csv")
    value = {(row.table, row.group, row.what): row.value for row in found}
    assert value["versions", "all", "time ratio, ours / baseline"] == pytest.approx(0.5, abs=0.02)
    for unknown in (
        ("orientation", "all", "gaps identified correctly, ours"),
        ("order", "all", "time ratio, ten trials later in a half"),
        ("locations", "library/spot0", "brightness factor, ours"),
    ):
        assert value[unknown] is None
    slopes = [row for row in found if row.what == "change of ln(time) per ln(brightness ratio)"]
    assert slopes
    assert {row.value for row in slopes} == {None}


def test_ramps_follow_from_luminances_and_the_display(importing) -> None:
    """A display of 104.4 cd/m^2: 52.2 of white is factor 0.5; 10.4 cd/m^2 in 5 s is a rate of 2.08."""
    outcome, trials = importing(RAMPS, "ramp", *RAMP_OPTIONS, "--display", "varjo-xr3")
    assert [t["rate_cd_m2_s"] for t in trials] == pytest.approx([2.08, 2.08, 0.0, 0.84])
    assert [t["is_catch"] for t in trials] == [False, False, True, False]
    # 52.1, 52.2 and 52.3 are one level, at their mean of 52.2; 20.9 is another.
    assert [t["initial_luminance_cd_m2"] for t in trials] == pytest.approx([52.2, 52.2, 52.2, 20.9])
    assert [t["factor"] for t in trials] == pytest.approx([0.5, 0.5, 0.5, 20.9 / 104.4])
    assert trials[0]["final_luminance_cd_m2"] == pytest.approx(52.2 - 10.4)
    assert {(t["screen"], t["procedure"], t["direction"]) for t in trials} == {("white", "yes_no", "down")}
    assert "2 luminances within 2% of others are one with them" in outcome.out


def test_a_catch_trial_with_a_rate_and_a_ramp_beyond_the_display_are_refused(importing, tmp_path) -> None:
    text = "participant,factor,rate,duration,is_catch,direction,response\n"
    units = ("--unit", "rate=nit/s", "--unit", "duration=s", "--display", "varjo-xr3")
    outcome, _ = importing(text + "a,0.5,2,5,yes,down,no\n", "ramp", *units)
    words = "table.csv, line 2: rate is 2 cd/m^2/s, but is_catch says that nothing changed"
    assert refusal(outcome, tmp_path) == words
    # 52.2 + 20 x 5 is 152.2, on a display of 104.4 cd/m^2.
    outcome, _ = importing(text + "a,0.5,20,5,no,up,yes\n", "ramp", *units)
    assert "line 2: the ramp ends at 152.2 cd/m^2, but the display 'varjo-xr3' shows 104.4" in outcome.err


def test_relative_rates_are_of_the_initial_luminance(importing) -> None:
    text = "participant,factor,rate,duration,response\na,50,4,5,yes\n"
    _, trials = importing(
        text,
        "ramp",
        "--unit",
        "factor=%",
        "--unit",
        "rate=%/s",
        "--unit",
        "duration=s",
        "--display",
        "varjo-xr3",
    )
    assert trials[0]["initial_luminance_cd_m2"] == pytest.approx(52.2)
    assert trials[0]["rate_cd_m2_s"] == pytest.approx(0.04 * 52.2)


@pytest.mark.slow
def test_imported_ramps_are_fitted_as_those_they_were_made_from(
    tmp_path, command, short_ramps, blank_pictures
) -> None:
    people = ("--participants", 2, "--seed", 3, "--design", short_ramps)
    command("simulate", "ramp", *people, "--out", tmp_path / "made", "--quiet")
    rows = ["vp;L;rate;s;yes"]
    for path in sorted((tmp_path / "made").glob("sub-*/ses-01/trials.jsonl")):
        for t in map(json.loads, path.read_text().splitlines()):
            numbers = (t["initial_luminance_cd_m2"], t["rate_cd_m2_s"], t["duration_s"])
            cells = [t["participant_id"], *(str(n).replace(".", ",") for n in numbers), t["response"]]
            rows.append(";".join(cells))
    (tmp_path / "lab.csv").write_text("\n".join(rows))
    made = command(
        "import", tmp_path / "lab.csv", "--task", "ramp", "--display", "varjo-xr3", "--simulated",
        "--column", "participant_id=vp", "--column", "initial_luminance=L", "--unit", "initial_luminance=nit",
        "--column", "rate=rate", "--unit", "rate=nit/s", "--column", "duration=s", "--unit", "duration=s",
        "--column", "response=yes", "--out", tmp_path / "imported",
    )  # fmt: skip
    assert made.code == 0, made.err
    thresholds = {}
    for name in ("made", "imported"):
        fitted = command("fit", tmp_path / name, "--out", tmp_path / f"fit-{name}")
        assert fitted.code == 0, fitted.err
        lines = (tmp_path / f"fit-{name}/thresholds.csv").read_text().splitlines()
        keys = lines[0].split(",")
        found = [dict(zip(keys, line.split(","), strict=True)) for line in lines[1:]]
        thresholds[name] = [row for row in found if row["screen"] == "white" and row["factor"] != "1.0"]
    assert len(thresholds["made"]) >= 4
    imported = {
        (r["participant_id"], round(float(r["luminance_cd_m2"]), 3)): r for r in thresholds["imported"]
    }
    for row in thresholds["made"]:
        other = imported[row["participant_id"], round(float(row["luminance_cd_m2"]), 3)]
        assert float(other["threshold_cd_m2_s"]) == pytest.approx(float(row["threshold_cd_m2_s"]), rel=1e-6)
        assert row["drift_p"] != ""
        assert other["drift_p"] == ""  # of the order of rows nothing is said


def test_a_pattern_of_columns_may_name_several_of_ours(importing) -> None:
    """Two columns of each answer, told apart by their ends; a repetition is a number."""
    text = "participant;r1_gym_ours;r2_gym_ours;t1_gym_ours;t2_gym_ours\na;3;4;2,5;1,5\n"
    _, trials = importing(
        text, "rating", "--wide", "rating=r{repetition}_{sequence}_{version}",
        "--wide", "response_time=t{repetition}_{sequence}_{version}", "--unit", "response_time=s",
    )  # fmt: skip
    assert [(t["repetition"], t["rating"], t["response_time_s"]) for t in trials] == [
        (1, 3, 2.5),
        (2, 4, 1.5),
    ]


def test_a_wide_list_may_lack_answers(importing) -> None:
    people = [{"subject": "a", "gym_ours": 4, "gym_baseline": 3}, {"subject": "b", "gym_ours": 2}]
    outcome, trials = importing(json.dumps(people), "rating", "--wide", "rating={sequence}_{version}")
    assert [(t["participant_id"], t["version"], t["rating"]) for t in trials] == [
        ("P01", "ours", 4),
        ("P01", "baseline", 3),
        ("P02", "ours", 2),
    ]
    assert "skipped 1 row without a rating (trial 2)" in outcome.out


def test_identifiers_become_names_of_folders(importing) -> None:
    text = RATINGS.replace("a,gym", "VP-3_a,gym").replace("gym", "Gym (day)")
    _, trials = importing(text, "rating")
    assert {(t["participant_id"], t["sequence"]) for t in trials} == {("VP3a", "Gym_day")}


def test_whole_numbers_that_a_table_with_gaps_wrote_with_a_point_stay_whole(importing) -> None:
    _, trials = importing(RATINGS.replace("a,gym,ours,4", "1.0,gym,ours,4.0").replace("a,", "1.0,"), "rating")
    assert {t["participant_id"] for t in trials} == {"1"}
    assert [t["rating"] for t in trials] == [4, 3]


def test_the_source_is_told(importing, tmp_path) -> None:
    importing(PSYCHOPY, "rating", *PSYCHOPY_OPTIONS)
    source = read_json_record(SessionManifest, tmp_path / "lab/sub-07/ses-001/manifest.json").source
    assert source is not None
    assert source.columns["trial_index"] == "trials.thisN"
    assert source.units == {"response_time": "s"}
    assert source.values == {"version:ours": "TBM", "version:baseline": "const"}
    assert len(source.sha256) == 64
