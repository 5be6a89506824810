"""Where the files of a data set lie (BIDS-like), for those who write it and those who read it."""

from __future__ import annotations

from pathlib import Path

from evenlight.data_schema.errors import InputError

DESCRIPTION = "dataset_description.json"
PARTICIPANTS = "participants.tsv"
STUDY = "study.toml"
PREREGISTRATIONS = "preregistration*.md"
MANIFEST = "manifest.json"
TRIALS = "trials.jsonl"
FRAMES = "frames.jsonl"
HEADSET = "headset.jsonl"
EVENTS = "events.jsonl"
BEHAVIOUR_FOLDER = "beh"
LOCK = ".session.lock"
DATASET_LOCK = ".dataset.lock"
SIMULATED_TRUTH = "simulated_truth.json"
SWEEPS = "sweeps"  # displays measured with instruments, without participants
SWEEP_MANIFEST = "sweep.json"
READINGS = "readings.jsonl"
# What BIDS does not define, as `.bidsignore` has it.
NOT_OF_BIDS = (
    *(f"**/{name}" for name in (MANIFEST, TRIALS, FRAMES, HEADSET, EVENTS, LOCK)),
    SIMULATED_TRUTH,
    STUDY,
    PREREGISTRATIONS,
    SWEEPS,
)
# What a played video's power is measured on.
POWER_LOG = "power_log.json"
POWER_SAMPLES = "power.csv"
CLOCK_PINGS = "clock.csv"
FLIPS = "flips.csv"
FLASHES = "flashes.csv"
BACKLIGHT_SETTINGS = "backlight.csv"


def require_apart(out: Path, dataset: Path) -> None:
    """Raise `InputError` if results would be written into a data set: what was recorded stays as it is."""
    is_dataset = (dataset / DESCRIPTION).is_file() or any(dataset.glob(f"sub-*/ses-*/{MANIFEST}"))
    inside = out.resolve() == dataset.resolve() or dataset.resolve() in out.resolve().parents
    if is_dataset and inside:
        raise InputError(
            f"the folder {out} lies in the data set {dataset}; results go elsewhere, so that what was "
            "recorded stays apart from what was made of it"
        )


def session_folder(dataset: Path, participant_id: str, session_id: str) -> Path:
    """Return the folder of one participant's session.

    >>> session_folder(Path("lab"), "01", "02").as_posix()
    'lab/sub-01/ses-02'
    """
    return dataset / f"sub-{participant_id}" / f"ses-{session_id}"


def behaviour_file(dataset: Path, participant_id: str, session_id: str, task: str) -> Path:
    """Return the exported table of a session's trials; its column descriptions lie beside it as json.

    >>> behaviour_file(Path("lab"), "01", "02", "ramp").as_posix()
    'lab/sub-01/ses-02/beh/sub-01_ses-02_task-ramp_beh.tsv'
    """
    stem = f"sub-{participant_id}_ses-{session_id}_task-{task}_beh"
    return session_folder(dataset, participant_id, session_id) / BEHAVIOUR_FOLDER / f"{stem}.tsv"


def sweep_folder(dataset: Path, task: str, session_id: str) -> Path:
    """Return the folder of a sweep.

    >>> sweep_folder(Path("lab"), "luminance-sweep", "01").as_posix()
    'lab/sweeps/luminance-sweep_01'
    """
    return dataset / SWEEPS / f"{task}_{session_id}"


def sweep_folders(dataset: Path, task: str) -> list[Path]:
    """Return the folders of a data set's sweeps of one task, in order of name."""
    return sorted(path.parent for path in dataset.glob(f"{SWEEPS}/{task}_*/{SWEEP_MANIFEST}"))
