"""A whole session through the real window on a virtual screen: unbroken, and killed and resumed."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from evenlight.data_schema.recordings.dataset_layout import EVENTS, FRAMES, MANIFEST
from evenlight.data_schema.recordings.ramp import Placement, Procedure, RampDesign

SHORT: dict[str, Any] = {
    "screens": ("white",),
    "factors": (0.3, 0.9),
    "adaptation_duration": 0.05,
    "ramp_durations": (0.25,),
    "hold_duration": 0.05,
    "interval_gap": 0.1,
    "pause_duration": 0.05,
    "practice_trials": 1,
    "trials_between_breaks": 6,
}
DESIGNS = {
    "yes_no constant": RampDesign(relative_rates=(0.1, 0.4), repetitions=3, **SHORT),  # 12 ramps, 3 catches
    "two_interval targeted": RampDesign(
        procedure=Procedure.TWO_INTERVAL,
        placement=Placement.TARGETED,
        relative_rates=(0.05, 1.0),
        trials_per_level=7,
        **SHORT,
    ),
}
SCREENS = {  # by their first lines
    "page-welcome",  # consent
    "page-try-the-keys",
    "page-your-task",
    "page-that-was-the-practice",
    "page-time-for-a-break",
    "page-thank-you",
}
OWN_SCREENS = {
    "yes_no constant": {"ramp", "question-did-the-brightness-change"},
    "two_interval targeted": {"ramp", "ramp-1", "ramp-2", "question-in-which-of-the-two-did"},
}
CHANGES = {"onset_s", "attempt"}  # what an interruption may change: when, and how often, a trial was shown


@pytest.mark.parametrize("name", list(DESIGNS))
def test_a_killed_and_resumed_session_gives_the_trials_of_an_unbroken_one(
    tmp_path: Path,
    name: str,
    small_rig: Path,
    laboratory: Callable[..., Any],
    virtual_screen: Callable[..., str],
    command: Callable[..., Any],
) -> None:
    """Rows are compared whole: rates, answers, response times, and what was read back from the window."""
    lab = laboratory(tmp_path, "ramp", DESIGNS[name], virtual_screen(), "--rig", small_rig)
    shots = tmp_path / "screens"
    assert "complete" in lab.run("whole", "--screenshots", shots)
    lab.kill_in_the_midst("broken")
    recorded = lab.rows("broken")
    lab.run("broken", "--resume")
    whole, broken = lab.rows("whole"), lab.rows("broken")
    assert broken[: len(recorded)] == recorded  # no completed trial is lost
    assert without_onsets(broken) == without_onsets(whole)
    assert len(whole) == 1 + lab_trials(DESIGNS[name])
    _check_light(whole, lab.rows("whole", FRAMES))
    _check_screens(shots, SCREENS | OWN_SCREENS[name])
    for dataset in ("whole", "broken"):
        assert command("validate", tmp_path / dataset).code == 0
    interrupted = {e["trial_index"] for e in lab.rows("broken", EVENTS) if e["kind"] == "trial_interrupted"}
    assert interrupted == {row["trial_index"] for row in broken if row["attempt"] > 1}
    manifest = json.loads((tmp_path / "whole/sub-01/ses-01" / MANIFEST).read_text())
    assert manifest["simulated"]
    assert manifest["apparatus"]["psychopy"]


def without_onsets(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{key: value for key, value in row.items() if key not in CHANGES} for row in rows]


def lab_trials(design: RampDesign) -> int:
    """Main trials, counted by hand: 12 ramps and a fifth of all as catches; or 7 at 2 levels."""
    return 15 if design.procedure is Procedure.YES_NO else 14


def _check_light(trials: list[dict[str, Any]], frames: list[dict[str, Any]]) -> None:
    """Every trial says what was read back, and it was what was meant; the display has 104 cd/m^2."""
    for trial in trials:
        assert trial["largest_luminance_error_cd_m2"] < 0.02
        initial, final = trial["initial_luminance_cd_m2"], trial["final_luminance_cd_m2"]
        ramp = [f for f in frames if f["trial_index"] == trial["trial_index"]][
            (trial["ramp_interval"] or 1) - 1
        ]
        assert ramp["probe_luminance_cd_m2"][0] == pytest.approx(initial, abs=0.02)
        assert ramp["probe_luminance_cd_m2"][-1] == pytest.approx(final, abs=0.02)
        assert len(ramp["probe_frames"]) >= 5


def _check_screens(folder: Path, wanted: set[str]) -> None:
    """There is a picture of each screen, and those with text have ink on them."""
    assert wanted <= {path.stem for path in folder.glob("*.png")}
    for path in [*folder.glob("page*.png"), *folder.glob("question*.png")]:
        low, high = Image.open(path).convert("L").getextrema()
        assert high - low > 50, path
