"""Kills a command at a rename, an fsync or half a write, in forks of this process, and does it again.

`python tests/companions/kill_points.py FOLDER CASE ...` kills each case at every such step; with `last:`
before its name at its last rename only. It says how often, and ends with 1 if anything was half or left over.
"""

from __future__ import annotations

import csv
import importlib
import json
import os
import re
import shutil
import signal
import stat
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
WARM = (
    "av", "matplotlib.pyplot", "pandas", "scipy.optimize", "statsmodels.api", "evenlight.command",
    "evenlight.analysis.dataset_findings", "evenlight.analysis.tracks.track_results",
    "evenlight.experiments.run_session",
)  # fmt: skip
KINDS = ("rename", "fsync", "half")
FINISHED = "this session is complete"
IDS = ["--participant", "01", "--session", "01", "--rig", "simulated", "--simulate", "data", "--seed", "1"]
TRACK = ["--budget", "0.5", "--rate-limit", "limit.json", "--no-player", "--out"]
APPLY = ["apply", "a.mkv", "track", "--force", "--out", "out.mkv"]
RAMP = ["simulate", "ramp", "--participants", "2", "--design", "ramp.design.toml", "--out"]
CHANGES = ("onset_s", "attempt", "flag")  # of a trial, by an interruption


@dataclass(frozen=True)
class Case:
    """A command, and what was made before it in the same place."""

    words: list[str]
    before: list[str] = field(default_factory=list)
    grows: bool = False  # what was recorded or finished before the kill stays


def session(task: str, *more: str) -> Case:
    words = ["run", task, *IDS, "--design", f"{task}.design.toml", *more, "--out", "out"]
    return Case(words, grows=True)


CASES = {
    "optimize": Case(["optimize", "a.mkv", *TRACK, "out"], before=["optimize", "b.mkv", *TRACK, "out"]),
    "control": Case(["control", "a.mkv", "--target-loss", "0.1", "--no-player", "--out", "out"]),
    "catalogue": Case(["catalogue", "films", "--budget", "0.5", "--no-player", "--out", "out"], grows=True),
    "apply": Case(APPLY, before=[*APPLY, "--version", "constant"]),
    "fit": Case(["fit", "lab", "--model", "pooled", "--out", "out"]),
    "analyze": Case(["analyze", "lab", "--out", "out"], before=["analyze", "ratings", "--out", "out"]),
    "simulate": Case([*RAMP, "out"]),
    "import": Case(["import", "ratings.csv", "--task", "rating", "--out", "out"]),
    "export-bids": Case(["export", "lab", "--to", "bids", "--out", "out"]),
    "export-psych-ds": Case(["export", "lab", "--to", "psych-ds", "--out", "out"]),
    "run-ramp": session("ramp"),
    **{f"run-{task}": session(task, "--stimuli", "stimuli") for task in ("rating", "comparison", "search")},
}


def make_inputs(folder: Path) -> Path:
    """Make short films, a track, stimuli, a table and data sets."""
    import numpy as np
    from blind_sessions import SMALL
    from catalogues import clip
    from conftest import write_stimulus
    from optimized_videos import limit_file

    from evenlight.data_schema.recordings.search import SearchDesign
    from evenlight.data_schema.recordings.viewing import ComparisonDesign, RatingDesign
    from evenlight.data_schema.storage.text_files import write_toml_record
    from evenlight.stimuli.scenes.content.catalogue import path_named

    for seed, name in enumerate(("a.mkv", "b.mkv", "films/c.mkv")):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        clip(folder / name, seed, 6)
    limit_file(folder / "limit.json", 1000.0)
    designs = {
        "ramp": SMALL,
        "rating": RatingDesign(sequences=("a", "b")),
        "comparison": ComparisonDesign(sequences=("a", "b")),
        "search": SearchDesign(sequences=("library",), keypoints=("library/stacks",), practice_trials=1),
    }
    for task, design in designs.items():
        write_toml_record(folder / f"{task}.design.toml", design)
    walk = round(path_named("library").duration * 10)
    for name, frames in {"a": 10, "b": 10, "library": walk}.items():
        write_stimulus(folder / "stimuli" / name, np.linspace(0.3, 0.7, frames), frames_per_second=10.0)
    versions = ("ours", "baseline")
    rows = [f"P{k:02d},{s},{v},{3 + (k + len(v)) % 3}" for k in range(4) for s in "ab" for v in versions]
    (folder / "ratings.csv").write_text("\n".join(["participant,sequence,version,rating", *rows]) + "\n")
    ratings = [*CASES["import"].words[:-1], "ratings"]
    for words in ([*RAMP, "lab"], ratings, ["optimize", "a.mkv", *TRACK, "track"]):
        code, said = ended(folder, words)
        assert code == 0, said
    return folder


def ended(at: Path, words: list[str], kind: str = "", number: int = 0) -> tuple[int, str]:
    """Return the exit code of a command in a folder, and what it said; it is killed at a step from 1 on."""
    told = at.with_name(f"{at.name}.told")
    child = os.fork()
    if not child:
        code = 1
        try:
            os.chdir(at)
            handle = os.open(told, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            os.dup2(handle, 1)
            os.dup2(handle, 2)
            steps = _killed_at(kind, number)
            code = _run(words)
            print(f"\n{steps()}")
        finally:
            sys.stdout.flush()
            os._exit(code)
    status = os.waitpid(child, 0)[1]
    return os.waitstatus_to_exitcode(status), told.read_text()


def _run(words: list[str]) -> int:
    from evenlight import command as command_line

    try:
        if words[0] == "catalogue":  # with workers that are threads: they are killed, too
            from catalogues import cluster_here

            with cluster_here(1) as address:
                command_line.main([*words, "--cluster", address, "--quiet"])
        command_line.main([*words, "--quiet"])
    except SystemExit as end:
        return int(end.code or 0)
    return 0


def _killed_at(kind: str, number: int) -> Callable[[], int]:
    """Kill this process at a step of one kind; return what tells how many there were."""
    done = 0

    def step(last: Callable[[], object] = lambda: None) -> None:
        nonlocal done
        done += 1
        if done == number:
            last()
            os.kill(os.getpid(), signal.SIGKILL)

    def counted(usual: Callable[..., Any]) -> Callable[..., Any]:
        def act(*given: Any, **more: Any) -> Any:
            step()
            return usual(*given, **more)

        return act

    write = os.write

    def halved(handle: int, data: bytes) -> int:
        if handle > 2 and stat.S_ISREG(os.fstat(handle).st_mode):
            step(lambda: write(handle, data[: len(data) // 2]))
        return write(handle, data)

    if kind == "rename":
        os.rename, os.replace = counted(os.rename), counted(os.replace)
    elif kind == "fsync":
        os.fsync = counted(os.fsync)
    elif kind == "half":
        os.write = halved  # type: ignore[assignment] # of bytes, as all here write
    return lambda: done


def tree(folder: Path) -> dict[str, str]:
    """Return every file below a folder, hidden ones too, without times, and sums of files with times."""
    found = {}
    times = r'"?(solve_s|curves_s|bound_s|started|utc|seconds|video_state)"?[:=] ?("[^"]*"|[^,}\n]*)'
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        text = path.read_bytes().decode("latin-1").replace(str(folder), "")
        if path.suffix in (".json", ".csv", ".toml", ".html", "") or path.name == "SHA256SUMS":
            text = re.sub(rf"{times}|[0-9a-f]{{64}}|tcp://[\d.:]+|took the workers [\d.]+", "", text)
        if path.name == "catalogue.csv":
            text = str([{**row, "seconds": ""} for row in csv.DictReader(text.splitlines())])
        found[path.relative_to(folder).as_posix()] = text
    return found


def differing(one: dict[str, str], other: dict[str, str]) -> list[str]:
    """Return the names of files that are not in both, or not the same."""
    return sorted(name for name in {*one, *other} if one.get(name) != other.get(name))


def problem_of(case: Case, before: Path, after: Path, at: Path, kind: str, number: int) -> str:
    """Kill a case at a step, do it again, and return what is wrong; nothing if all is well."""
    shutil.copytree(before, at)
    code, said = ended(at, case.words, kind, number)
    if code != -signal.SIGKILL:
        return f"ended with {code}: {said}"
    seen = {name: text for name, text in tree(at).items() if not _is_on_the_way(name)}
    whole = [tree(before), tree(after)]
    if (before / "out").is_dir():  # gone between two renames
        whole.append({name: text for name, text in whole[0].items() if not name.startswith("out/")})
    if not case.grows and seen not in whole:
        return f"half: {differing(seen, tree(after))}"
    code, said = ended(at, case.words)
    if code == 2 and "go on with it with --resume" in said:
        code, said = ended(at, [*case.words, "--resume"])
    if code and not (FINISHED in said or ("is there already" in said and tree(at) == tree(after))):
        return f"the second ended with {code}: {said}"
    if case.words[0] == "run":
        return _session_problem(at / "out", after / "out")
    left = differing(tree(at), tree(after))
    return f"otherwise than undisturbed: {left}" if left else ""


def _is_on_the_way(name: str) -> bool:
    return any(part.startswith((".partial.", ".lock.", ".earlier.")) for part in Path(name).parts)


def _session_problem(out: Path, whole: Path) -> str:
    """Return what is wrong with a session that was killed and gone on with."""
    ours, theirs, folder = tree(out), tree(whole), "sub-01/ses-01"
    changed = [name for name in differing(ours, theirs) if folder not in name or name not in theirs]
    if changed or ours.keys() != theirs.keys():
        return f"otherwise than undisturbed: {changed or differing(ours, theirs)}"
    if json.loads((out / folder / "manifest.json").read_text())["status"] != "complete":
        return "not complete"
    if _trials(out / folder) != _trials(whole / folder):
        return "other trials"
    [table] = (out / folder).glob("beh/*.tsv")
    lines = len(table.read_text().splitlines()) - 1
    return "" if lines == len(_trials(out / folder)) else f"{lines} rows in {table.name}"


def _trials(folder: Path) -> list[dict[str, Any]]:
    lines = [json.loads(line) for line in (folder / "trials.jsonl").read_text().splitlines()]
    return [{key: value for key, value in one.items() if key not in CHANGES} for one in lines]


def kill(inputs: Path, name: str, *, everywhere: bool) -> list[str]:
    """Kill a case at every step, or the last rename, and return what was wrong."""
    case, at, problems = CASES[name], inputs.with_name(name), []
    before = Path(shutil.copytree(inputs, at / "before"))
    if case.before:
        code, said = ended(before, case.before)
        assert code == 0, said
    steps = {}
    for kind in KINDS if everywhere else KINDS[:1]:
        code, said = ended(Path(shutil.copytree(before, at / kind)), case.words, kind)
        assert code == 0, said
        steps[kind] = int(said.splitlines()[-1])
    for kind, count in steps.items():
        for number in range(1 if everywhere else count, count + 1):
            again = at / f"{kind}-{number}"
            if problem := problem_of(case, before, at / "rename", again, kind, number):
                problems.append(f"{name}: {kind} {number} of {count}: {problem}")
            shutil.rmtree(again)
    kills = sum(steps.values()) if everywhere else 1
    print(
        f"{name}: {kills} kills ({', '.join(f'{n} {k}' for k, n in steps.items())} steps)",
        *problems,
        sep="\n",
    )
    sys.stdout.flush()
    return problems


if __name__ == "__main__":
    sys.path[:0] = [str(HERE), str(HERE.parent)]
    os.environ["EVENLIGHT_CURVES_CACHE_MB"] = "0"
    for imported in WARM:  # once for all forks
        importlib.import_module(imported)
    from matplotlib.figure import Figure

    from evenlight.data_schema import provenance

    provenance._source_revision = lambda: "unknown"  # type: ignore[assignment] # of a tree that may change meanwhile
    drawn = Figure.savefig
    Figure.savefig = lambda *given, **more: drawn(*given, **more | {"dpi": 20})  # type: ignore[method-assign]
    made = make_inputs(Path(sys.argv[1]) / "inputs")
    wrong: list[str] = []
    for asked in sys.argv[2:] or CASES:
        wrong += kill(made, asked.removeprefix("last:"), everywhere=not asked.startswith("last:"))
    sys.exit(bool(wrong))
