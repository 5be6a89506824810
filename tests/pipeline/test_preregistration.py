"""A pre-registration is filled from the plan; each departure is found, and none in a run as planned."""

import dataclasses
import hashlib
import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from evenlight import command as command_line
from evenlight.analysis import dataset_findings
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions
from evenlight.analysis.dataset_findings import AnalysisOptions, find_in_dataset
from evenlight.analysis.plans.preregistration import departures_of, register, registered_in
from evenlight.analysis.plans.questions import RampQuestion
from evenlight.analysis.plans.ramp_plan import plan_ramps
from evenlight.analysis.ramp_loading import load_ramp_data
from evenlight.analysis.session_loading import load_task
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import RateLimitModel
from evenlight.data_schema.recordings.dataset_layout import POWER_LOG
from evenlight.data_schema.recordings.study import read_preregistration
from evenlight.data_schema.recordings.viewing import RatingTrial
from evenlight.data_schema.result_request import ResultRequest
from evenlight.data_schema.storage.text_files import write_toml_record
from evenlight.experiments.design_files import load_design

Run = Callable[..., Any]
FILE, SECOND = "preregistration.md", Path("sub-02", "ses-01")
SHORT = dataclasses.replace(load_design("recommended"), screens=("white",), trials_per_level=12)
JOINT = RateLimitOptions()


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four simulated participants, as was pre-registered: the seeds do not matter for that."""
    folder = tmp_path_factory.mktemp("planned")
    write_toml_record(folder / "short.design.toml", SHORT)
    (folder / "study.toml").write_text('authors = ["A. Reed"]\nlicence = "CC0-1.0"\n')
    people = ("ramp", "--participants", "4", "--design", folder / "short.design.toml", "--quiet", "--out")
    for words in (
        ("plan", *people, folder / "plan", "--quick", "--preregister", folder / FILE),
        ("simulate", *people, folder / "lab"),
    ):
        with pytest.raises(SystemExit) as ended:
            command_line.main([*map(str, words)])
        assert not ended.value.code
    shutil.move(folder / FILE, folder / "lab")
    return folder / "lab"


@pytest.fixture
def lab(planned: Path, tmp_path: Path) -> Path:
    return shutil.copytree(planned, tmp_path / "lab")


def registered(lab: Path, place: str, value: object) -> None:
    """Change the block at the end as if it had been written so."""
    text, _, block = (lab / FILE).read_text(encoding="utf-8").partition("```json\n")
    inner = content = json.loads(block.partition("\n```")[0])
    del content["sha256"]
    *outer, key = place.split(".")
    for name in outer:
        inner = inner[name]
    inner[key] = value
    content["sha256"] = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
    (lab / FILE).write_text(f"{text}```json\n{json.dumps(content)}\n```\n", encoding="utf-8")


def began(lab: Path) -> None:
    content = json.loads((lab / SECOND / "manifest.json").read_text())
    content["started"] = "2020-01-01T09:00:00.000+00:00"
    (lab / SECOND / "manifest.json").write_text(json.dumps(content))


def cut(lab: Path) -> None:
    lines = (lab / SECOND / "trials.jsonl").read_text().splitlines(keepends=True)
    (lab / SECOND / "trials.jsonl").write_text("".join(lines[:-3]))


@pytest.mark.parametrize(
    ("change", "options", "expected"),
    [
        (None, JOINT, []),
        (("participants", 6), JOINT, ["4 participants instead of 6"]),
        (cut, JOINT, ["other numbers of trials that count than planned: participant 02 (57 of 60)"]),
        (
            lambda lab: shutil.move(lab / "sub-02", lab.parent), JOINT,
            ["3 participants instead of 4", "listed, but without a session"],
        ),
        (
            lambda lab: (lab / "sub-02").rename(lab / "sub_02"), JOINT,
            ["3 participants instead of 4", "sub_02 is left out, which was not planned", "listed, but"],
        ),
        (("design.factors", [0.5]), JOINT, ["factors 0.2, 0.4, 0.6, 0.8, 1.0 instead of 0.5"]),
        (("design.procedure", "yes_no"), JOINT, ["procedure two_interval instead of yes_no"]),
        (("display", "mine"), JOINT, ["display varjo-xr3 instead of mine"]),
        (
            None, RateLimitOptions(model=RateLimitModel.POOLED, degree=3),
            ["analysed with degree 3 instead of unset", "analysed with model pooled instead of joint"],
        ),
        (
            None, RateLimitOptions(
                procedure=SHORT.procedure, direction=SHORT.directions[0],
                ramp_duration=SHORT.ramp_durations[0],
            ), [],
        ),
        (("options", {"model": "joint", "band_level": 0.95}), JOINT, []),  # before there were others
        (None, RateLimitOptions(ramp_duration=9.0), ["analysed with ramp_duration 9.0 instead of 5.0"]),
        (began, JOINT, ["collected before it was written: participant 02"]),
        (("provenance.software_version", "3.0.0"), JOINT, ["with Evenlight 0.1.0 instead of 3.0.0"]),
    ],
)  # fmt: skip
def test_each_departure_is_found_and_no_other(
    lab: Path, change: Any, options: RateLimitOptions, expected: list[str]
) -> None:
    if isinstance(change, tuple):
        registered(lab, *change)
    elif change:
        change(lab)
    first, *found = departures_of(registered_in(lab, ("ramp",)), {"ramp": (load_ramp_data(lab), options)})
    many = {0: "no departure ", 1: "1 departure "}.get(len(expected), f"{len(expected)} departures ")
    assert first.startswith(f"ramp: {many}from the pre-registration {lab / FILE} of 20")
    assert len(found) == len(expected)
    for words, begins in zip(found, expected, strict=True):
        assert words.startswith(f"ramp: {begins}")


def test_departures_come_first_on_the_terminal_in_the_report_and_the_summary(lab: Path, command: Run) -> None:
    registered(lab, "participants", 6)
    for name, summary in (("fit", "fit_summary.json"), ("analyze", "analysis.json")):
        out = lab.parent / name
        ended = command(name, lab, "--out", out)
        lines = [line for line in ended.out.splitlines() if line]
        assert lines[0].startswith("ramp: 1 departure from the pre-registration"), ended.err
        assert lines[1] == "ramp: 4 participants instead of 6"
        assert json.loads((out / summary).read_text())["departures"] == lines[:2]
        titles = re.findall(r"<h2[^>]*>([^<]+)<", (out / "report.html").read_text(encoding="utf-8"))
        assert titles[0].startswith("Departures from the pre-registration")
    assert command("export", lab, "--to", "bids", "--out", lab.parent / "bids").code == 0
    assert (lab.parent / "bids" / FILE).read_bytes() == (lab / FILE).read_bytes()
    shutil.copy(lab / FILE, lab / "preregistration-2.md")
    plans = registered_in(lab, ("ramp",))
    assert len(departures_of(plans, {"ramp": (load_ramp_data(lab), JOINT)})) == 4  # two of each
    assert registered_in(lab.parent, ("ramp",)) == {}


def test_ratings_of_another_lab_have_no_design_and_another_scale(lab: Path, command: Run) -> None:
    """And what else is analysed beside them was not pre-registered."""
    rows = [f"{who},gym,{version},{who + 1}" for who in (1, 2, 3) for version in ("ours", "baseline")]
    (lab.parent / "theirs.csv").write_text("\n".join(["participant,sequence,version,rating", *rows]))
    words = ("--task", "rating", "--scale", "1..7", "--out", lab.parent / "theirs", "--quiet")
    assert command("import", lab.parent / "theirs.csv", *words).code == 0
    plan = ("plan", "rating", "--participants", "3", "--quick", "--quiet", "--out", lab.parent / "plan")
    assert command(*plan, "--preregister", lab.parent / "own.md").code == 0
    data = load_task(lab.parent / "theirs", "rating", RatingTrial)
    runs = {"rating": (data, AnalysisOptions()), "ramp": (load_ramp_data(lab), JOINT)}
    assert departures_of(registered_in(lab, runs, lab.parent / "own.md"), runs)[1:] == (
        "rating: design unknown instead of known",
        "rating: scale 1 to 7 in whole points instead of 1 to 5 in whole points",
        "ramp: not pre-registered",
    )


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"participants": 4', '"participants": 3', "was changed"),
        ('"participants": 4', '"participants": ', "not valid JSON"),
        ("```json", "```", "missing"),
    ],
)
def test_a_changed_or_foreign_file_is_refused_in_one_line(
    lab: Path, command: Run, old: str, new: str, said: str
) -> None:
    (lab / "own.md").write_text((lab / FILE).read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    ended = command("fit", lab, "--preregistered", lab / "own.md", "--out", lab.parent / "fit")
    assert (ended.code, ended.err.count("\n"), said in ended.err) == (2, 1, True), ended.err
    assert command("validate", lab).code == 0
    shutil.move(lab / "own.md", lab / FILE)
    for path in (lab, lab / FILE):
        ended = command("validate", path)
        assert (ended.code, said in ended.out + ended.err) == (1, True), ended


def test_a_changed_one_and_one_of_another_experiment_are_refused_before_the_analysis(
    lab: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dataset_findings, "_analysed", lambda *_: pytest.fail("analysed first"))
    registered(lab, "task", "rating")
    with pytest.raises(InputError, match=r"of the experiment rating, which is not analysed"):
        find_in_dataset(lab, AnalysisOptions(preregistered=lab / FILE), lab.parent)
    (lab / FILE).write_text("nothing", encoding="utf-8")
    with pytest.raises(InputError, match="was changed"):
        find_in_dataset(lab, AnalysisOptions(), lab.parent)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((FILE,), "a new file"),
        (("preregistration.txt",), "a new file, .md"),  # which fit would not find
        (("none/there.md",), "in a folder that is there"),
        (("new.md", "--trials", "20"), "which says what --trials would"),
        (("new.md", "--design", "paper", "--design", "quick"), "one --design"),
        (("new.md", "--analysis", "nowhere"), "nowhere"),
    ],
)
def test_what_cannot_be_registered_is_refused(
    lab: Path, command: Run, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], said: str
) -> None:
    monkeypatch.chdir(lab)
    monkeypatch.setattr("evenlight.analysis.plans.ramp_plan.plan_ramps", lambda *_: pytest.fail("simulated"))
    ended = command("plan", "ramp", "--out", "plan", "--preregister", *words)
    assert (ended.code, said in ended.err, Path("new.md").exists()) == (2, True, False), ended.err


def test_what_would_not_be_used_is_refused(lab: Path, tmp_path: Path, command: Run) -> None:
    words = ("plan", "ramp", "--quick", "--quiet", "--participants", "2", "--trials", "12")
    ended = command(*words, "--analysis", lab, "--out", tmp_path / "plan")
    assert (ended.code, "--preregister FILE" in ended.err, (tmp_path / "plan").exists()) == (2, True, False)
    (lab / POWER_LOG).touch()
    ended = command("fit", lab, "--preregistered", lab / FILE, "--out", tmp_path / "fit")
    assert (ended.code, "ramp, which is not analysed here" in ended.err) == (2, True), ended.err


def test_the_text_says_what_the_plan_the_design_and_the_study_say(planned: Path) -> None:
    text = (planned / FILE).read_text(encoding="utf-8")
    for words in (
        "- Authors: A. Reed\n", "- Licence of the data: CC0-1.0\n", "12 ramps at each luminance",
        "- Ethics approval: [to be filled in: committee, number, date]", "\n`evenlight fit planned",
        "4 participants. That number is given", "in 75 % of the ramps, but for lapses.",
        "the last answer is given again beyond chance (p < 0.001)", "planned half-width of a pointwise one ",
    ):  # fmt: skip
        assert words in text
    assert read_preregistration(planned / FILE).design == SHORT


def test_another_analysis_is_registered_by_an_earlier_result_of_fit(tmp_path: Path) -> None:
    asked = {"dataset": "pilot", "out": "fit", "model": "individual", "degree": 2}
    write_toml_record(tmp_path / "request.toml", ResultRequest("fit", asked=asked))
    write_toml_record(tmp_path / "short.design.toml", SHORT)
    design = str(tmp_path / "short.design.toml")
    question = RampQuestion(trials="12", design=(design,), analysis=str(tmp_path))
    plan = plan_ramps(question, (2,), pool=2)
    register(tmp_path / FILE, question, plan, (design, SHORT), "2026-11-29T09:00:00.000+00:00")
    text = (tmp_path / FILE).read_text(encoding="utf-8")
    assert f"`evenlight fit {tmp_path.name} --degree 2 --model individual --out results`" in text
    assert "A logistic psychometric function of each participant" in text
    assert read_preregistration(tmp_path / FILE).options["model"] == "individual"


@pytest.mark.parametrize(
    ("task", "options", "told"),
    [
        ("rating", (), ("8 trials of a participant", "--task rating --out results`")),
        ("comparison", ("--margin", "0.2"), ("within 0.5 ± 0.2 ", "margin 0.2", "--margin 0.2 --out")),
        ("search", ("--margin", "1.5"), ("a ratio of 1.5 or more", "margin 1.5", "--slowing 0.5 --out")),
    ],
)
def test_the_text_of_a_viewing_experiment_has_its_tests_and_the_command(
    tmp_path: Path, command: Run, task: str, options: tuple[str, ...], told: tuple[str, ...]
) -> None:
    words = ("plan", task, "--quick", "--quiet", *options, "--participants", "9", "--out", tmp_path / "plan")
    assert command(*words, "--preregister", tmp_path / FILE).code == 0
    text = (tmp_path / FILE).read_text(encoding="utf-8")
    rows = json.loads((tmp_path / "plan" / "plan.json").read_text())["rows"]
    assert all(f"- {row['test']}: level {row['level']:.3g}" in text for row in rows)
    assert all(words in text for words in (*told, "9 participants. ", "`order_seed` = 1"))
    assert len(re.findall("(?m)^## ", text)) == 11
