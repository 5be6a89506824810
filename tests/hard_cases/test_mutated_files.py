"""Files with small damage, of every kind that is read: refused in one line or read, and nothing else.

No traceback, no hang, no memory without bound, no half-written result. About a thousand mutants here; more of
them by hand: `EVENLIGHT_MUTANTS=10000 pytest -s -n 0 tests/hard_cases/test_mutated_files.py`.
"""

import os
import re
import resource
import shutil
import signal
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas  # noqa: F401 - here, so that its import is not on the clock of the first file that needs it
import pytest
from foreign_files import FORMATS
from gltf_files import room
from mutants import mutant

from evenlight.analysis.played_power.power_recording import load_recording
from evenlight.analysis.ramp_loading import load_ramp_data
from evenlight.analysis.session_loading import undamaged_roll
from evenlight.analysis.sweeps.sweep_loading import load_sweep
from evenlight.data_schema.checking.validation import validate
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.export.exporting import export_psych_ds
from evenlight.data_schema.importing.import_dataset import import_dataset
from evenlight.data_schema.importing.import_request import ImportRequest, import_request
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.instrument_logs import (
    ClockPing,
    FlashMark,
    PlayedFlip,
    PowerLog,
    PowerSample,
)
from evenlight.data_schema.storage.tables import read_rows, write_rows
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.data_schema.threshold import Threshold
from evenlight.data_schema.tracks.brightness_track import (
    BudgetUnit,
    read_sections,
    read_track,
)
from evenlight.data_schema.tracks.loss_curves import read_loss_curves
from evenlight.experiments import design_files
from evenlight.experiments.design_files import load_sweep_design, load_task_design
from evenlight.experiments.sessions import pages
from evenlight.experiments.sessions.pages import load_pages
from evenlight.experiments.sessions.session_store import resume_session
from evenlight.experiments.viewing.simulate_viewing import (
    ViewingSimulation,
    load_simulation,
    simulate_viewing,
)
from evenlight.hardware.backlight_curve import read_backlight_curve
from evenlight.hardware.luminance_table import luminance_readings_from_csv
from evenlight.hardware.protocols import InstrumentError
from evenlight.hardware.rig_files import RIGS, load_rig
from evenlight.method.choices import SolverName
from evenlight.method.optimizer.optimize import optimize, pose
from evenlight.method.optimizer.request import Request
from evenlight.method.optimizer.splitting import make_solver
from evenlight.method.preset_files import (
    PRESETS,
    load_contrast_model,
    load_display,
    load_power_model,
    load_rate_limit,
)
from evenlight.stimuli.scenes.content import catalogue
from evenlight.stimuli.scenes.gltf.gltf_file import read_gltf
from evenlight.stimuli.scenes.gltf.gltf_scene import scene_from_gltf
from evenlight.stimuli.sequences import open_video

MUTANTS = int(os.environ.get("EVENLIGHT_MUTANTS", "1000"))
LONGEST = 5.0  # [s] for one mutant
MOST_TAKEN = 500 << 10  # [KiB] of memory for one mutant
MOST_MEMORY = 2 << 30  # [bytes] beyond what the process has already, for the sake of the computer
THRESHOLDS = (
    "participant_id,screen,factor,luminance_cd_m2,threshold_cd_m2_s,ci_low,ci_high,standard_error_ln,width,"
    "guess_rate,lapse_rate,false_alarm_rate,n_trials,n_catch,flag\n"
    "01,white,0.5,52.2,2,1,3,0.2,1.1,0.1,0.02,,48,12,\n02,white,0.5,52.2,2.5,1.5,3,0.2,1.1,0.1,0.02,0.1,48,12,\n"
)
RATINGS = "participant,session,sequence,version,rating\n" + "".join(
    f"p{p},1,{sequence},{version},{rating}\n"
    for p, rating in ((1, 3), (2, 4))
    for sequence in ("gym", "library")
    for version in ("ours", "baseline")
)
BINARY_TABLES = ("Excel.xlsx", "OpenDocument.ods", "SPSS.sav", "Stata.dta")
TRIALS = '[{"participant": "1", "session": "1", "sequence": "gym", "version": "ours", "rating": 3}]'
MAPPING = '[columns]\nrating = "rating"\n[values.version]\nours = "ours"\n[constants]\nsession_id = "1"\n'


class HangError(Exception):
    """A mutant that takes too long."""


@dataclass(frozen=True)
class Kind:
    """A kind of file: where it lies, and what reads it."""

    path: Path
    read: Callable[[Path], Any]
    cost: int = 1  # so many times fewer mutants: it takes longer to read


def optimized(curves: Path, **given: Any) -> None:
    """The track of eight frames, by a rate limit, a power model or sections of a file."""
    asked = {
        "budget": 0.6, "budget_unit": BudgetUnit.POWER, "power_model": load_power_model("surace2025"),
        "rate_limit": load_rate_limit("surace2025"),
    } | given  # fmt: skip
    problem = pose(read_loss_curves(curves), Request(**asked))
    optimize(problem, make_solver(SolverName.SPLITTING, np.random.default_rng(1)))


def simulate_ratings(out: Path, stimuli: Path) -> None:
    """A data set of two simulated participants who rate the track of a folder."""
    loaded = load_simulation("rating", stimuli, (2, 1), "varjo-xr3", str(stimuli.parent / "one.design.toml"))
    written(out, lambda: simulate_viewing(loaded, out))


def frames_of(path: Path) -> None:
    """All frames of a video."""
    for _ in open_video(str(path)).frames():
        pass


def import_ratings(out: Path, table: Path, mapping: Path | None = None) -> None:
    """A data set of another program's table."""
    asked = import_request(ImportRequest("rating", (table,)), {}, mapping)
    written(out, lambda: import_dataset(asked, out))


def written(out: Path, write: Callable[[], object]) -> None:
    """A result that is there whole or not at all."""
    shutil.rmtree(out, ignore_errors=True)
    try:
        write()
    except (InputError, InstrumentError):
        assert not out.exists(), f"half-written: {sorted(out.rglob('*'))}"
        raise
    assert not list(out.parent.glob(".partial.*"))


def simulate_design(out: Path, design: Path) -> None:
    """A data set of two simulated participants in a design."""
    loaded = design_files.load_design(str(design))
    asked = ViewingSimulation(1, 1, "ramp", load_display("varjo-xr3"), loaded)
    written(out, lambda: simulate_viewing(asked, out))


def session_read(dataset: Path, out: Path) -> None:
    """A data set: checked, its ramps loaded, exported."""
    list(validate(dataset))
    try:
        load_ramp_data(dataset, undamaged_roll(dataset))
    finally:
        written(out, lambda: export_psych_ds(dataset, out))


def resumed(dataset: Path, copy: Path) -> None:
    """A session goes on where it was, in a copy."""
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(dataset, copy)
    with resume_session(copy, "01", "01"):
        pass


def write_power(folder: Path) -> None:
    """Measured power as `measure played` keeps it, of a tenth of a second."""
    folder.mkdir()
    log = PowerLog(
        simulated=True, video="v", duration=0.1, passes=("ours",), refresh_rate=60.0, sample_rate=100.0,
        mean_factor=0.5, baseline_factor=0.5, sync_connected=True, apparatus={},
        provenance=Provenance(), started="",
    )  # fmt: skip
    write_json_record(folder / "power_log.json", log)
    times = np.arange(12) / 100
    write_rows(
        folder / "power.csv",
        PowerSample,
        [PowerSample(k, float(t), float(t), 1.25, k % 2 == 0) for k, t in enumerate(times)],
    )
    write_rows(folder / "clock.csv", ClockPing, [ClockPing(t, t + 1e-4, t + 2e-4) for t in (0.0, 0.05, 0.1)])
    write_rows(folder / "flashes.csv", FlashMark, [FlashMark(t, 0.2) for t in (0.0, 0.1)])
    shown = [PlayedFlip(0, "ours", 0.01 + k / 60, k, 0.5, 0.5, k % 2 == 0) for k in range(5)]
    write_rows(folder / "flips.csv", PlayedFlip, shown)


@pytest.fixture(scope="module")
def kinds(tmp_path_factory, make_stimulus, make_video) -> dict[str, Kind]:
    """A whole file of every kind."""
    root = tmp_path_factory.mktemp("whole")
    for preset in ("varjo-xr3.display.toml", "surace2025.power.toml", "surace2025.rate_limit.json"):
        shutil.copy(PRESETS / preset, root)
    shutil.copy(PRESETS / "default.contrast_model.toml", root)
    shutil.copy(RIGS / "desk.rig.toml", root)
    for design in design_files.DESIGNS.glob("quick*.toml"):
        shutil.copy(design, root)
    shutil.copy(root / "quick.design.toml", root / "simulated.design.toml")
    make_stimulus(root / "track", np.linspace(0.9, 0.5, 8))
    shutil.copytree(root / "track", root / "whole")
    shutil.copytree(root / "track", root / "stimuli" / "gym")
    (root / "one.design.toml").write_text('sequences = ["gym"]\n')
    make_video(root / "clip.mkv", np.linspace(0.2, 0.9, 4), (32, 24), 10.0)
    (root / "arrays").mkdir()
    np.save(root / "arrays" / "frame.npy", np.full((8, 8), 0.5))
    write_png(root / "pictures")
    scene = room()
    scene.add_texture(0, (root / "pictures/a.png").read_bytes())
    (root / "room.glb").write_bytes(scene.content())
    texts = {
        "thresholds.csv": THRESHOLDS,
        "weights.csv": "start_s,end_s,weight\n0,0.5,2.5\n1,1.5,0\n",
        "allowances.csv": "start_s,end_s,allowance\n0,0.5,2.5\n1,1.5,0\n",
        "ratings.csv": RATINGS,
        "mapped.toml": MAPPING,
        "trials.json": TRIALS,
        "meter.csv": "pixel_value,luminance_cd_m2,factor\n0,0.1,\n0.5,22,\n1,100,1\n1,50,0.5\n",
    }
    for name, text in texts.items():
        (root / name).write_text(text)
    for name in BINARY_TABLES:
        FORMATS[name](root / name, [line.split(",") for line in RATINGS.splitlines()])
    (root / "brightness.csv").write_text(brightness_table())
    shutil.copytree(pages.SHIPPED / "de", root / "pages")
    shutil.copy(catalogue.PATHS / "gym.json", root / "path.json")
    write_power(root / "power")
    design = design_files.load_design("quick")
    simulate_viewing(ViewingSimulation(2, 1, "ramp", load_display("varjo-xr3"), design), root / "lab")
    make_sweeps(root / "sweeps")
    interrupted(root)
    return kinds_in(root)


def brightness_table() -> str:
    """A table of brightness levels, as a sweep leaves it."""
    from evenlight.data_schema.recordings.sweep_fit import LuminanceLevel
    from evenlight.data_schema.storage.tables import columns_of

    rows = [{"factor": b, "achieved_factor": b, "luminance_cd_m2": 100 * b} for b in (0.25, 0.5, 1.0)]
    columns = columns_of(LuminanceLevel)
    return (
        "\n".join([",".join(columns), *(",".join(str(row.get(c, "")) for c in columns) for row in rows)])
        + "\n"
    )


def write_png(folder: Path) -> None:
    """One small picture."""
    from PIL import Image

    folder.mkdir()
    Image.fromarray(np.full((12, 12, 3), 90, dtype=np.uint8)).save(folder / "a.png")


def make_sweeps(out: Path) -> None:
    """Two short sweeps of a simulated display."""
    from evenlight.experiments.run_command import Rehearsal, run

    for task in ("luminance-sweep", "power-sweep"):
        run(
            task, "1", "simulated", out, design="quick", simulate=Rehearsal.DATA, quiet=True,
            participant=None, stimuli=None, seed=None, language=None, pages=None, font=None, screenshots=None,
        )  # fmt: skip


def interrupted(root: Path) -> None:
    """A session that was interrupted."""
    shutil.copytree(root / "lab", root / "stopped")
    manifest = root / "stopped/sub-01/ses-01/manifest.json"
    manifest.write_text(manifest.read_text().replace('"complete"', '"running"'))


def kinds_in(root: Path) -> dict[str, Kind]:
    """What reads which file."""
    lab, stopped, power = root / "lab", root / "stopped", root / "power"
    luminance, power_sweep = (f"sweeps/sweeps/{task}-sweep_1" for task in ("luminance", "power"))
    whole = root / "whole" / "loss_curves.npz"
    session, scratch = "sub-01/ses-01", root / "out"
    ramps = Kind(root, lambda _: session_read(lab, scratch), 4)
    power_read = Kind(root, lambda _: load_recording(power), 2)
    resuming = Kind(root, lambda _: resumed(stopped, scratch), 4)
    found = {
        "varjo-xr3.display.toml": Kind(root, load_display),
        "surace2025.power.toml": Kind(
            root, lambda path: optimized(whole, power_model=load_power_model(path)), 2
        ),
        "surace2025.rate_limit.json": Kind(
            root, lambda path: optimized(whole, rate_limit=load_rate_limit(path)), 2
        ),
        "default.contrast_model.toml": Kind(root, load_contrast_model),
        "desk.rig.toml": Kind(root, lambda path: load_rig(str(path))),
        "quick.design.toml": Kind(root, lambda path: design_files.load_design(str(path))),
        "simulated.design.toml": Kind(root, lambda path: simulate_design(scratch, path), 4),
        **{
            f"quick.{task}.design.toml": Kind(root, lambda path, t=task: load_task_design(t, str(path)))
            for task in ("rating", "comparison", "search")
        },
        **{
            f"quick.{task}.design.toml": Kind(root, lambda path, t=task: load_sweep_design(t, str(path)))
            for task in ("luminance-sweep", "power-sweep")
        },
        "track/track.csv": Kind(root, read_track),
        "track/track.json": Kind(root, lambda path: read_track(path.with_suffix(".csv"))),
        "track/summary.json": Kind(root, lambda path: list(validate(path.parent))),
        "track/loss_curves.npz": Kind(root, optimized, 2),
        "stimuli/gym/track.csv": Kind(root, lambda _: simulate_ratings(scratch, root / "stimuli"), 2),
        "stimuli/gym/summary.json": Kind(root, lambda _: simulate_ratings(scratch, root / "stimuli"), 2),
        "stimuli/gym/loss_curves.npz": Kind(root, lambda _: simulate_ratings(scratch, root / "stimuli"), 2),
        "thresholds.csv": Kind(root, lambda path: read_rows(Threshold, path)),
        "weights.csv": Kind(root, lambda path: optimized(whole, weights=read_sections(path, "weight")), 2),
        "allowances.csv": Kind(
            root, lambda path: optimized(whole, allowances=read_sections(path, "allowance")), 2
        ),
        "ratings.csv": Kind(root, lambda path: import_ratings(scratch, path), 2),
        "trials.json": Kind(root, lambda path: import_ratings(scratch, path), 2),
        **{name: Kind(root, lambda path: import_ratings(scratch, path), 8) for name in BINARY_TABLES},
        "mapped.toml": Kind(root, lambda path: import_ratings(scratch, root / "ratings.csv", path), 2),
        "meter.csv": Kind(root, luminance_readings_from_csv),
        "brightness.csv": Kind(root, read_backlight_curve),
        "pages/question_yes_no.txt": Kind(root, lambda path: load_pages("en", path.parent), 2),
        "pages/keys.toml": Kind(root, lambda path: load_pages("en", path.parent), 2),
        "path.json": Kind(root, lambda path: catalogue.path_named(str(path))),
        "clip.mkv": Kind(root, frames_of, 2),
        "room.glb": Kind(root, lambda path: scene_from_gltf(read_gltf(path))),
        "arrays/frame.npy": Kind(root, lambda path: frames_of(path.parent)),
        "pictures/a.png": Kind(root, lambda path: frames_of(path.parent)),
        f"{luminance}/readings.jsonl": Kind(root, lambda path: load_sweep(path.parent)),
        f"{luminance}/sweep.json": Kind(root, lambda path: load_sweep(path.parent)),
        f"{power_sweep}/readings.jsonl": Kind(root, lambda path: load_sweep(path.parent)),
        f"{power_sweep}/events.jsonl": Kind(root, lambda path: list(validate(path))),
        f"lab/{session}/trials.jsonl": ramps,
        f"lab/{session}/manifest.json": ramps,
        "lab/participants.tsv": ramps,
        "lab/dataset_description.json": ramps,
        f"lab/{session}/beh/sub-01_ses-01_task-ramp_beh.tsv": ramps,
        f"stopped/{session}/trials.jsonl": resuming,
        f"stopped/{session}/manifest.json": resuming,
        **{f"power/{name}": power_read for name in ("power_log.json", "power.csv", "clock.csv", "flips.csv")},
    }
    return {name: Kind(root / name, kind.read, kind.cost) for name, kind in found.items()}


@contextmanager
def bounded() -> Iterator[None]:
    """End what takes too long, and refuse what takes too much memory."""

    def hang(*_: object) -> None:
        raise HangError

    before = resource.getrlimit(resource.RLIMIT_AS)
    if sys.platform == "linux":
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + MOST_MEMORY, before[1]))
    handler = signal.signal(signal.SIGALRM, hang)
    signal.setitimer(signal.ITIMER_REAL, LONGEST)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, handler)
        resource.setrlimit(resource.RLIMIT_AS, before)


def resident(of: str) -> int:
    """What the process holds in memory, or held at most since this was asked [KiB]; 0 but on Linux."""
    status = Path("/proc/self/status")
    found = re.search(rf"{of}:\s+(\d+)", status.read_text()) if status.exists() else None
    return int(found[1]) if found else 0


def outcome(kind: Kind) -> str:
    """What becomes of a file: read, refused in a line, or what must not be."""
    if (peak := Path("/proc/self/clear_refs")).exists():
        peak.write_text("5")  # the peak is that from now on
    before = resident("VmRSS")
    found = ending(kind)
    taken = resident("VmHWM") - before
    return found if taken < MOST_TAKEN else f"took {taken >> 10} MiB, {found}"


def ending(kind: Kind) -> str:
    """How the reading of a file ends."""
    try:
        with bounded():
            with suppress(InputError):  # no record by its name, say
                list(validate(kind.path))
            kind.read(kind.path)
    except (InputError, InstrumentError) as error:
        return "refused" if "\n" not in str(error).strip() else f"several lines: {error}"
    except HangError:
        return "HANG " + "".join(traceback.format_exc().splitlines()[-4:-1])[-300:]
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        return (
            f"{type(error).__name__}: {str(error)[:120]} at {last.filename.rpartition('/')[2]}:{last.lineno}"
        )
    return "read"


def share_of(kind: Kind, kinds: dict[str, Kind]) -> int:
    """How many mutants of a kind there are."""
    return max(1, round(MUTANTS / kind.cost / sum(1 / each.cost for each in kinds.values())))


def test_whole_files_are_read(kinds: dict[str, Kind]) -> None:
    """Else the mutants would prove nothing: they would all be refused for another reason."""
    assert {name: outcome(kind) for name, kind in kinds.items()} == dict.fromkeys(kinds, "read")


def test_every_mutant_is_read_or_refused_in_one_line(kinds: dict[str, Kind]) -> None:
    wrong = []
    for name, kind in kinds.items():
        whole, began = kind.path.read_bytes(), time.perf_counter()
        outcomes: Counter[str] = Counter()
        for number in range(share_of(kind, kinds)):
            kind.path.write_bytes(mutant(whole, f"{name} {number}"))
            outcomes[found := outcome(kind)] += 1
            if found not in ("read", "refused"):
                wrong.append(f"{name} {number}: {found}")
        kind.path.write_bytes(whole)
        print(f"{name:55} {dict(outcomes)} {time.perf_counter() - began:.1f} s", flush=True)
    assert not wrong, "\n".join(wrong)
