"""`evenlight run`: a whole session without a window, what it leaves, and what it refuses."""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from blind_sessions import RIG, SMALL, arguments, rows, written

from evenlight.data_schema.recordings.dataset_layout import EVENTS, FRAMES, MANIFEST, TRIALS
from evenlight.data_schema.recordings.ramp import RampDesign, RampTrial

Command = Callable[..., Any]


@pytest.fixture
def design(tmp_path: Path) -> Path:
    return written(SMALL, tmp_path)


def test_a_whole_session_leaves_a_data_set_that_validates(
    command: Command, tmp_path: Path, design: Path
) -> None:
    lab = tmp_path / "lab"
    ended = command(*arguments(lab, design))
    assert (ended.code, ended.err) == (0, "")
    assert "complete: 10 of 10 trials" in ended.out
    assert command("validate", lab).code == 0
    trials = rows(lab)
    assert [t["practice"] for t in trials] == [True] * 2 + [False] * 10
    assert all(t["simulated"] for t in trials)
    assert [t["trial_index"] for t in trials] == list(range(12))
    manifest = json.loads((lab / "sub-01/ses-01" / MANIFEST).read_text())
    assert (manifest["status"], manifest["n_trials"], manifest["simulated"]) == ("complete", 10, True)
    assert manifest["rig"]["name"]
    assert len(manifest["pages"]["consent"]) == 64


def test_frames_are_logged_for_every_interval(command: Command, tmp_path: Path, design: Path) -> None:
    """0.1 + 0.5 + 0.1 s at 60 Hz are 42 frames."""
    command(*arguments(tmp_path / "lab", design))
    frames = rows(tmp_path / "lab", FRAMES)
    trials = rows(tmp_path / "lab")
    assert [f["trial_index"] for f in frames] == [t["trial_index"] for t in trials]
    for frame, trial in zip(frames, trials, strict=True):
        assert len(frame["flip_times_s"]) == len(frame["intended_luminance_cd_m2"]) == trial["n_frames"] == 42
        assert frame["intended_luminance_cd_m2"][0] == pytest.approx(trial["initial_luminance_cd_m2"])
        assert frame["intended_luminance_cd_m2"][-1] == pytest.approx(trial["final_luminance_cd_m2"])


def test_events_tell_the_course_of_the_session(command: Command, tmp_path: Path, design: Path) -> None:
    """Consent, two keys, instructions, two trials with feedback, breaks after 4 and 8 of 10, thanks."""
    command(*arguments(tmp_path / "lab", design))
    events = rows(tmp_path / "lab", EVENTS)
    pages = [e["detail"] for e in events if e["kind"] == "page_shown"]
    practice = ["instructions_yes_no", "feedback", "feedback", "practice_end"]
    assert pages == ["consent", "key_test", "key_test", *practice, "break", "break", "end"]
    assert [e["kind"] for e in events][:3] == ["started", "page_shown", "consent_given"]
    assert events[-1]["kind"] == "completed"
    assert sum(e["kind"] == "trial_begun" for e in events) == 12


def test_a_rehearsal_is_the_same_every_time_and_another_for_everybody(
    command: Command, tmp_path: Path, design: Path
) -> None:
    for name in ("a", "b"):
        command(*arguments(tmp_path / name, design))
    assert rows(tmp_path / "a") == rows(tmp_path / "b")
    other = arguments(tmp_path / "a", design)
    other[other.index("--participant") + 1] = "02"
    command(*other)
    first, second = rows(tmp_path / "a"), rows(tmp_path / "a", participant="02")
    assert [t["rate_cd_m2_s"] for t in first] != [t["rate_cd_m2_s"] for t in second]


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"--rig": "nowhere.rig.toml"}, "nowhere.rig.toml: no such rig"),
        (
            {"--participant": "Anna-Maria"},
            "--participant must be letters and digits, a digit among them, such as 01, got 'Anna-Maria'",
        ),
        ({"--participant": "Anna"}, "a digit among them, such as 01, got 'Anna'"),
        ({"--session": "a-b"}, "--session must be letters and digits"),
        ({"--design": "papr"}, "papr"),
        ({"--seed": "-1"}, "seed must be 0 or more, got -1"),
        ({"--language": "xx"}, "there are no pages in the language 'xx', only in de, en"),
        ({"--pages": "nowhere"}, "nowhere: no such folder"),
        ({"--screenshots": "here"}, "--screenshots needs a window, which --simulate data does not open"),
        ({"--resume": None}, "there is no session to resume"),
        ({"--out": "/proc/lab"}, "cannot write to the folder /proc/lab"),
    ],
)
def test_bad_input_ends_in_one_line_and_leaves_nothing(
    command: Command, tmp_path: Path, design: Path, changed: dict[str, str | None], message: str
) -> None:
    words = arguments(tmp_path / "lab", design)
    for option, value in changed.items():
        if option in words:
            words[words.index(option) + 1] = str(value)
        else:
            words += [option, *([value] if value is not None else [])]
    ended = command(*words)
    assert ended.code == 2
    assert message in ended.err
    assert ended.err.count("\n") == 1
    assert not (tmp_path / "lab").exists()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name = ", "not valid TOML"),
        (RIG.replace("display", "dispaly"), "unknown key 'dispaly'; did you mean 'display'?"),
        (RIG.replace('display = "varjo-xr3"\n', ""), "the key 'display' of a rig is missing"),
        (RIG.replace("varjo-xr3", "bench.toml"), "the display of the rig 'desk' cannot be loaded"),
        (RIG.replace("varjo-xr3", ""), "display must name a calibrated display"),
        (RIG.replace("60.0", "0"), "refresh_rate_hz must be at least 20 Hz, got 0"),
        (RIG + '[keys]\nyes = "n"\n', "the keys yes, no, proceed and pause must differ"),
        (RIG + 'actuator = "backlight"\n', "so backlight must name one, got 'none'"),
        (RIG + '[keys]\nyes = "yyy"\n', "yes must match"),
        (RIG + "bits = 12\n", "bits must be 8 or 10, got 12"),
    ],
)
def test_a_rig_that_cannot_be_used_is_refused_in_one_line(
    command: Command, tmp_path: Path, design: Path, text: str, message: str
) -> None:
    path = tmp_path / "bad.rig.toml"
    path.write_text(text)
    words = arguments(tmp_path / "lab", design)
    words[words.index("--rig") + 1] = str(path)
    ended = command(*words)
    assert (ended.code, ended.err.count("\n")) == (2, 1)
    assert message in ended.err
    assert not (tmp_path / "lab").exists()


def test_slopes_that_the_display_would_clip_are_refused(command: Command, tmp_path: Path) -> None:
    """Black is 20 of 100 cd/m^2: a ramp from 100 by 18 %/s for 5 s would end at 10."""
    (tmp_path / "washed.toml").write_text(
        'name = "washed"\npeak_luminance_cd_m2 = 100.0\nblack_level_cd_m2 = 20.0\n'
        "gamma = 2.2\npixels_per_degree = 40.0\n"
    )
    (tmp_path / "washed.rig.toml").write_text(RIG.replace("varjo-xr3", "washed.toml"))
    design = written(RampDesign(screens=("white",), factors=(1.0,), relative_rates=(0.18,)), tmp_path)
    words = arguments(tmp_path / "lab", design)
    words[words.index("--rig") + 1] = str(tmp_path / "washed.rig.toml")
    ended = command(*words)
    assert ended.code == 2
    assert "100" in ended.err
    assert "20" in ended.err
    assert not (tmp_path / "lab").exists()


@pytest.mark.parametrize("rehearsal", ["data", "visual"])
def test_ramps_below_the_backlights_lowest_factor_are_refused_before_a_window_opens(
    command: Command, tmp_path: Path, rehearsal: str
) -> None:
    """99.5 % less than b = 0.04 is b = 0.0002; 12 bits have 1/4095 = 0.00024. From 0.06 on it is 0.0003."""
    (tmp_path / "dimmer.rig.toml").write_text(RIG + 'actuator = "backlight"\nbacklight = "simulated"\n')
    steep = RampDesign(
        screens=("white",), factors=(0.04,), relative_rates=(0.199,), repetitions=1, practice_trials=0
    )
    words = arguments(tmp_path / "lab", written(steep, tmp_path))
    words[words.index("--rig") + 1] = str(tmp_path / "dimmer.rig.toml")
    words[words.index("--simulate") + 1] = rehearsal
    ended = command(*words)
    assert (ended.code, ended.err.count("\n")) == (2, 1)
    # 104.4 cd/m^2 at full brightness, divided by 4095
    assert "beyond 0.02549 cd/m^2, the darkest that 'varjo-xr3' reaches by its backlight" in ended.err
    assert not (tmp_path / "lab").exists()
    written(dataclasses.replace(steep, factors=(0.06,)), tmp_path)
    words[words.index("--simulate") + 1] = "data"
    assert command(*words).code == 0


def test_a_rehearsal_without_a_window_needs_no_backlight_of_the_rigs_computer(
    command: Command, tmp_path: Path, design: Path
) -> None:
    text = RIG + 'actuator = "backlight"\nbacklight = "sysfs:no_panel_of_this_name"\n'
    (tmp_path / "panel.rig.toml").write_text(text)
    words = arguments(tmp_path / "lab", design)
    words[words.index("--rig") + 1] = str(tmp_path / "panel.rig.toml")
    assert command(*words).code == 0
    words = arguments(tmp_path / "other", design)
    words[words.index("--rig") + 1] = str(tmp_path / "panel.rig.toml")
    words[words.index("--simulate") + 1] = "visual"
    ended = command(*words)
    assert (ended.code, ended.err.count("\n")) == (1, 1)
    assert "no_panel_of_this_name: no such backlight" in ended.err
    assert not (tmp_path / "other").exists()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('"factor": 0.5', '"factor": 0.7'), "the session's design has no white screen at factor 0.7"),
        (('"rate_cd_m2_s": ', '"rate_cd_m2_s": 9'), "cd/m^2/s for 0.5 s ends at"),
        (('"duration_s": 0.5', '"duration_s": -1'), "duration_s must be above 0 s, got -1"),
    ],
)
def test_rows_out_of_range_are_refused_by_the_fit(
    command: Command, tmp_path: Path, design: Path, change: tuple[str, str], message: str
) -> None:
    command(*arguments(tmp_path / "lab", design))
    path = tmp_path / "lab/sub-01/ses-01" / TRIALS
    lines = path.read_text().splitlines(keepends=True)
    ramps = ('"practice": false', '"is_catch": false', change[0])
    place = next(k for k, line in enumerate(lines) if all(part in line for part in ramps))
    lines[place] = lines[place].replace(*change)
    path.write_text("".join(lines))
    ended = command("fit", tmp_path / "lab", "--out", tmp_path / "fit")
    assert (ended.code, ended.err.count("\n")) == (2, 1)
    assert message in ended.err
    assert not (tmp_path / "fit").exists()


def test_frames_that_are_lost_are_found(command: Command, tmp_path: Path, design: Path) -> None:
    command(*arguments(tmp_path / "lab", design))
    (tmp_path / "lab/sub-01/ses-01" / FRAMES).write_text("")
    ended = command("validate", tmp_path / "lab")
    assert ended.code == 1
    assert "no frames of trial 0, attempt 1, interval 1" in ended.out


def test_sessions_of_one_participant_have_another_order_of_blocks(command: Command, tmp_path: Path) -> None:
    both = RampDesign(
        factors=(0.5,), relative_rates=(0.02, 0.06), repetitions=1, practice_trials=0, ramp_durations=(0.5,)
    )
    design = written(both, tmp_path)
    first = arguments(tmp_path / "lab", design)
    second = [word if word != "01" or first[k - 1] != "--session" else "02" for k, word in enumerate(first)]
    for words in (first, second):
        assert command(*words).code == 0
    screens = []
    for session in ("01", "02"):
        path = tmp_path / f"lab/sub-01/ses-{session}" / TRIALS
        screens.append(json.loads(path.read_text().splitlines()[0])["screen"])
    assert sorted(screens) == ["gray", "white"]


def test_the_columns_of_the_export_are_described(command: Command, tmp_path: Path, design: Path) -> None:
    command(*arguments(tmp_path / "lab", design))
    sidecar = tmp_path / "lab/sub-01/ses-01/beh/sub-01_ses-01_task-ramp_beh.json"
    content = json.loads(sidecar.read_text())
    assert len([c for c in content.values() if isinstance(c, dict)]) == len(RampTrial.__slots__)
    assert content["rate_cd_m2_s"]["Units"] == "cd/m^2/s"
    assert set(content["direction"]["Levels"]) == {"down", "up"}
