"""A display measured again in mid-study: `run`, `validate` and `fit` agree on what goes together."""

import dataclasses
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from blind_sessions import rows, written

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.dataset_layout import EVENTS, MANIFEST, PARTICIPANTS, TRIALS
from evenlight.data_schema.recordings.ramp import RampDesign
from evenlight.data_schema.storage.text_files import write_toml_record
from evenlight.experiments.stimulus_folder import load_stimuli
from evenlight.method.preset_files import load_display

Command = Callable[..., Any]
DESIGN = RampDesign(
    screens=("white",),
    factors=(0.2, 0.5, 1.0),
    relative_rates=(0.01, 0.03, 0.09),
    repetitions=5,
    practice_trials=1,
    trials_between_breaks=0,
    adaptation_duration=0.1,
    ramp_durations=(0.5,),
    hold_duration=0.1,
)
# White is L = b · peak without black level and reflections: 50, 125, 250, and 4 % less of each.
BEFORE = Display("desk", 250.0, 0.0, 2.2, 38.0, measured="2026-10-01")
AFTER = Display("desk", 240.0, 0.0, 2.2, 38.0, measured="2026-11-01")
LEVELS = {"01": [50.0, 125.0, 250.0], "02": [48.0, 120.0, 240.0]}


class Laboratory:
    """A rig whose display has the calibration that is asked for, and a data set."""

    def __init__(self, command: Command, folder: Path) -> None:
        self.command, self.folder, self.dataset = command, folder, folder / "lab"
        self.design = written(DESIGN, folder)

    def rig(self, display: Display) -> Path:
        write_toml_record(self.folder / "d.display.toml", display)
        path = self.folder / "d.rig.toml"
        words = f'name = "desk"\ndisplay = "{self.folder}/d.display.toml"\n'
        path.write_text(words + "viewing_distance_m = 0.6\nrefresh_rate_hz = 60.0\n")
        return path

    def run(self, participant: str, display: Display, *more: object, dataset: str = "lab") -> Any:
        ids = ("--participant", participant, "--session", "01", "--simulate", "data", "--out")
        words = (*ids, self.folder / dataset, "--rig", self.rig(display), "--design", self.design, *more)
        return self.command("run", "ramp", *words)

    def fit(self) -> Any:
        out = self.folder / "fit"
        return self.command("fit", self.dataset, "--out", out, "--degree", 1, "--quiet")

    def add_from(self, other: str, participant: str) -> None:
        """Put a session of another data set into this one, as a file manager does."""
        name = f"sub-{participant}"
        shutil.copytree(self.folder / other / name, self.dataset / name)
        with (self.dataset / PARTICIPANTS).open("a") as listed:
            listed.write((self.folder / other / PARTICIPANTS).read_text().split("\n")[1] + "\n")


@pytest.fixture
def lab(command: Command, tmp_path: Path) -> Laboratory:
    return Laboratory(command, tmp_path)


def test_two_calibrations_four_percent_apart_make_one_data_set(lab: Laboratory) -> None:
    assert lab.run("01", BEFORE).err == ""
    again = lab.run("02", AFTER)
    note = (
        "the display 'desk' has another calibration than in earlier sessions: 240 cd/m^2, gamma 2.2, "
        "measured 2026-11-01; the newest of theirs, 250 cd/m^2, gamma 2.2, measured 2026-10-01"
    )
    assert (again.code, again.err) == (0, f"evenlight: note: {note}\n")
    assert [e["detail"] for e in rows(lab.dataset, EVENTS, "02") if e["kind"] == "recalibrated"] == [note]
    assert lab.run("03", AFTER).err == ""  # nothing new
    for participant, (dark, *_) in LEVELS.items():  # 0.03 /s is 1.5 cd/m^2/s at 50, and 1.44 at 48 cd/m^2
        trials = [t for t in rows(lab.dataset, TRIALS, participant) if not t["practice"]]
        rates = {t["rate_cd_m2_s"] for t in trials if t["initial_luminance_cd_m2"] == pytest.approx(dark)}
        assert sorted(rates) == pytest.approx([0.0, 0.01 * dark, 0.03 * dark, 0.09 * dark])
    checked = lab.command("validate", lab.dataset)
    assert checked.code == 0
    said = (
        "the display 'desk' was measured again between sessions (250 cd/m^2, gamma 2.2, measured 2026-10-01, "
        "sessions: 1; 240 cd/m^2, gamma 2.2, measured 2026-11-01, sessions: 2)"
    )
    assert f"note         {lab.dataset}: {said}" in checked.out
    shared = lab.folder / "shared"
    assert lab.command("export", lab.dataset, "--out", shared).code == 0
    assert said in lab.command("validate", shared).out
    fitted = lab.fit()
    assert (fitted.code, said in fitted.err) == (0, True)
    check_fit(lab.folder / "fit")


def check_fit(folder: Path) -> None:
    """Thresholds lie at each session's luminance, population levels between; the limit holds for both."""
    thresholds = pd.read_csv(folder / "thresholds.csv", dtype={"participant_id": str})
    for participant, levels in LEVELS.items():
        own = thresholds[thresholds.participant_id == participant]
        assert sorted(own.luminance_cd_m2) == pytest.approx(levels)
    summary = json.loads((folder / "fit_summary.json").read_text())
    # Geometric means of 50 and 48, 125 and 120, 250 and 240: three people at each, not one and two.
    means = [2400**0.5, 15000**0.5, 60000**0.5]
    assert sorted(level["luminance_cd_m2"] for level in summary["levels"]) == pytest.approx(means)
    assert {level["n_participants"] for level in summary["levels"]} == {3}
    limit = json.loads((folder / "rate_limit.json").read_text())
    assert limit["display_fingerprint"] == AFTER.fingerprint
    assert limit["display_fingerprints"] == [BEFORE.fingerprint, AFTER.fingerprint]
    page = (folder / "report.html").read_text()
    assert "desk: 240 cd/m², gamma 2.2, measured 2026-11-01" in page
    assert "02/01, 03/01" in page


@pytest.mark.parametrize(
    ("other", "reason"),
    [
        (
            Display("tv", 240.0, 0.0, 2.2, 38.0),
            "runs on the display 'tv', session 01 of participant 01 on 'desk': a rate limit holds for one "
            "display; put the sessions of each in a data set of its own (`run`: another --out), or, if it is "
            "one panel measured again, give its file the name 'desk'",
        ),
        (
            Display("desk", 150.0, 0.0, 2.2, 38.0),
            "runs on the display 'desk' with 150 cd/m^2 at pixel value 1 and factor 1, session 01 of "
            "participant 01 with 250: a ratio of 1.67",
        ),
    ],
    ids=["name", "brightness"],
)
def test_run_validate_and_fit_refuse_another_display_with_the_same_words(
    lab: Laboratory, other: Display, reason: str
) -> None:
    lab.run("01", BEFORE)
    before = {path: path.read_bytes() for path in lab.dataset.rglob("*") if path.is_file()}
    refused = lab.run("02", other)
    assert refused.code == 2
    assert f"{lab.dataset}: session 01 of participant 02 {reason}" in refused.err
    assert refused.err.count("\n") == 1
    assert {path: path.read_bytes() for path in lab.dataset.rglob("*") if path.is_file()} == before
    words = refused.err.removeprefix("evenlight: ").strip()
    assert lab.run("02", other, dataset="others").code == 0  # the way out
    lab.add_from("others", "02")
    checked = lab.command("validate", lab.dataset, "--quiet")
    assert (checked.code, checked.out) == (1, f"problem      {words}\n")
    fitted = lab.fit()
    assert (fitted.code, words in fitted.err) == (2, True)
    assert not (lab.folder / "fit").exists()


def test_ramps_without_a_display_are_told_by_validate_as_by_fit(lab: Laboratory) -> None:
    lab.run("01", BEFORE)
    path = lab.dataset / "sub-01/ses-01" / MANIFEST
    path.write_text(json.dumps(json.loads(path.read_text()) | {"display": None, "design": None}))
    words = f"{lab.dataset}: session 01 of participant 01 has no display (manifest.json: display is null)"
    checked = lab.command("validate", lab.dataset, "--quiet")
    assert (checked.code, f"problem      {words}" in checked.out) == (1, True)
    fitted = lab.fit()
    assert (fitted.code, words in fitted.err) == (2, True)


def test_a_session_is_resumed_under_the_calibration_that_it_began_with(lab: Laboratory) -> None:
    lab.run("01", BEFORE)
    folder = lab.dataset / "sub-01/ses-01"
    (folder / MANIFEST).write_text(
        (folder / MANIFEST).read_text().replace('"status": "complete"', '"status": "aborted"')
    )
    lines = (folder / TRIALS).read_text().splitlines(keepends=True)
    (folder / TRIALS).write_text("".join(lines[:-4]))
    refused = lab.run("01", AFTER, "--resume")
    assert (refused.code, "--rig (its display) is not as it was" in refused.err) == (2, True)
    assert (folder / TRIALS).read_text() == "".join(lines[:-4])
    assert lab.run("01", BEFORE, "--resume").code == 0


def test_a_track_of_an_earlier_calibration_is_refused_and_called_so(
    tmp_path: Path, make_stimulus: Callable[..., None]
) -> None:
    """Its rates were planned in the luminance measured then."""
    make_stimulus(tmp_path / "gym", [0.5, 0.6])
    then = load_display("varjo-xr3")
    now = dataclasses.replace(then, peak_luminance=0.97 * then.peak_luminance)
    assert len(load_stimuli(tmp_path, ("gym",), then, with_video=False)) == 1
    with pytest.raises(InputError, match=r"here is .* in another calibration: make a track .* --display"):
        load_stimuli(tmp_path, ("gym",), now, with_video=False)
