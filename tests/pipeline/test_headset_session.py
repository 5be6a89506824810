"""A session in a headset that is made up, killed in the midst of a trial and gone on with."""

import dataclasses
from pathlib import Path
from typing import Any

from evenlight.data_schema.recordings.dataset_layout import FRAMES, HEADSET
from evenlight.data_schema.recordings.ramp import RampDesign
from evenlight.data_schema.storage.text_files import write_toml_record
from evenlight.hardware.rig_files import load_rig

DESIGN = RampDesign(
    screens=("white",), factors=(0.4, 0.9), relative_rates=(0.1, 0.4), repetitions=1, catch_share=0.2,
    adaptation_duration=0.2, ramp_durations=(0.5,), hold_duration=0.1, pause_duration=0.1,
    practice_trials=1, trials_between_breaks=3,
)  # fmt: skip
CHANGES = {"onset_s", "attempt"}  # what an interruption may change


def test_a_session_that_was_killed_goes_on_as_it_would_have(
    tmp_path: Path, laboratory: Any, command: Any
) -> None:
    rig = dataclasses.replace(load_rig("simulated-headset")[0], window_size=(96, 96), refresh_rate=20.0)
    write_toml_record(tmp_path / "small.rig.toml", rig)
    lab = laboratory(tmp_path, "ramp", DESIGN, "", "--rig", tmp_path / "small.rig.toml", "--seed", 4)
    lab.run("whole")
    lab.kill_in_the_midst("killed")
    lab.run("killed", "--resume")
    whole, killed = (
        [{key: trial[key] for key in trial.keys() - CHANGES} for trial in lab.rows(name)]
        for name in ("whole", "killed")
    )
    assert killed == whole
    shown = {(log["trial_index"], log["attempt"]) for log in lab.rows("killed", FRAMES)}
    assert {(log["trial_index"], log["attempt"]) for log in lab.rows("killed", HEADSET)} >= shown
    assert command("validate", tmp_path / "killed").code == 0
