"""What tests of `evenlight run` without a window share: a small design, the command's words, its rows."""

import json
from pathlib import Path
from typing import Any

from evenlight.data_schema.recordings.dataset_layout import TRIALS
from evenlight.data_schema.recordings.ramp import RampDesign
from evenlight.data_schema.storage.text_files import write_toml_record

SMALL = RampDesign(
    screens=("white",),
    factors=(0.5, 1.0),
    relative_rates=(0.02, 0.06),
    repetitions=2,
    practice_trials=2,
    trials_between_breaks=4,
    adaptation_duration=0.1,
    ramp_durations=(0.5,),
    hold_duration=0.1,
)  # 8 ramps, 2 catch trials
RIG = 'name = "desk"\ndisplay = "varjo-xr3"\nviewing_distance_m = 0.6\nrefresh_rate_hz = 60.0\n'


def written(design: RampDesign, folder: Path) -> Path:
    path = folder / "small.design.toml"
    write_toml_record(path, design)
    return path


def arguments(dataset: Path, design: Path, *more: object) -> list[str]:
    ids = ["--participant", "01", "--session", "01", "--rig", "simulated", "--simulate", "data"]
    return ["run", "ramp", *ids, "--out", str(dataset), "--design", str(design), *map(str, more)]


def rows(dataset: Path, name: str = TRIALS, participant: str = "01") -> list[dict[str, Any]]:
    path = dataset / f"sub-{participant}/ses-01" / name
    return [json.loads(line) for line in path.read_text().splitlines()]
