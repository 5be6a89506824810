"""Windows and macOS: what Unix or Linux alone has is used where its absence is met, and nowhere else.

Neither system was at hand. Windows is simulated: modules, and names of others, are taken away before
Evenlight is imported (`tests/companions/without_unix.py`); the libraries stay those of Linux.
"""

import ast
import functools
import json
import os
import re
import subprocess
import sys
import time
import types
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import without_unix
from warm_evenlight import Run

import evenlight
from evenlight.hardware import device_passes
from evenlight.hardware.device_passes import PassRequest
from evenlight.hardware.measuring import Bench
from evenlight.stimuli.scenes.engine.array_cache import cache_folder

ROOT = Path(evenlight.__file__).parents[1]
FOLDERS = ("data_schema", "method", "hardware", "stimuli", "experiments", "analysis")
SCRIPT = Path(without_unix.__file__)
# Where such names stand, how often, and what keeps them from being used on Windows.
GUARDED = {
    "hardware/device_passes.py": {"SIGKILL": 1, "killpg": 1},  # HAS_UNIX: the player alone is ended
    "hardware/drivers/device_lock.py": {"fcntl": 1, "major": 1, "minor": 1},  # ImportError: nothing is locked
    "hardware/drivers/program_lines.py": {"SIGKILL": 2, "killpg": 1, "set_blocking": 1},  # require_unix
    "hardware/drivers/serial_link.py": {"termios": 1},  # ImportError: HAS_TERMINALS
    "data_schema/storage/binary_tables.py": {"resource": 1},  # sys.platform: memory is not limited
    # sys.platform: Windows has another clock
    "hardware/presentation/openxr_runtime.py": {"CLOCK_MONOTONIC": 1, "clock_gettime_ns": 1},
    "experiments/desktop/live_desktop.py": {"SIGUSR1": 1},  # sys.platform: refused on Windows
    "experiments/desktop/live_state.py": {"SIGUSR1": 1},  # the same
    "experiments/desktop/film_tracks.py": {"AF_UNIX": 1},  # the same
    "experiments/desktop/resting.py": {"getuid": 1},  # the same
    "experiments/follow/mpv_player.py": {"AF_UNIX": 1},  # hasattr, in follow_film.py
    "method/choices.py": {"sched_getaffinity": 1},  # hasattr
    "evenlight/command.py": {"SIGHUP": 1},  # hasattr
}


@functools.cache
def texts() -> dict[str, str]:
    """Return the texts of the product's modules by their path from the root."""
    paths = [*(ROOT / "evenlight").glob("*.py")]
    for folder in FOLDERS:
        paths += (ROOT / folder).rglob("*.py")
    return {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in paths}


def modules_with(pattern: str) -> Iterator[tuple[str, ast.Module]]:
    """Yield the modules in whose text a pattern is found: their path, and their syntax."""
    for path, text in texts().items():
        if re.search(pattern, text):
            yield path, ast.parse(text)


def unix_names(tree: ast.Module) -> Counter[str]:
    """How often a module imports, or takes of a module, what is absent on Windows."""
    absent = {module.__name__: set(names.split()) for module, names in without_unix.ABSENT.items()}
    found: Counter[str] = Counter()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found.update({each.name for each in node.names} & set(without_unix.GONE))
        elif isinstance(node, ast.ImportFrom) and not node.level:
            module = node.module or ""
            found.update({module} & set(without_unix.GONE))
            found.update({each.name for each in node.names} & absent.get(module, set()))
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            found.update({node.attr} & absent.get(node.value.id, set()))
    return found


def test_what_windows_has_not_is_used_in_guarded_places_alone() -> None:
    modules, names = "|".join(without_unix.GONE), "|".join(" ".join(without_unix.ABSENT.values()).split())
    pattern = rf"import.*\b({modules})\b|\.({names})\b|from (os|signal|socket|time|errno) import"
    found = {path: unix_names(tree) for path, tree in modules_with(pattern)}
    assert {path: dict(names) for path, names in found.items() if names} == GUARDED


def test_the_search_finds_each_import_and_attribute() -> None:
    text = "import os, pty\nfrom signal import SIGKILL\ndef f(): import tty\nos.killpg(1, 2); os.killpg(3, 4)"
    assert unix_names(ast.parse(text)) == {"pty": 1, "SIGKILL": 1, "tty": 1, "killpg": 2}


def called(tree: ast.Module) -> Iterator[tuple[str, ast.Call]]:
    """Yield the calls in a module, with their names."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            yield ast.unparse(node.func), node


def test_text_is_read_and_written_in_a_named_encoding() -> None:
    """Else it is that of the system: Windows has others than UTF-8."""
    unnamed = [
        f"{path}, line {call.lineno}"
        for path, tree in modules_with(r"\b(open|read_text|write_text|TextIOWrapper)\(")
        for name, call in called(tree)
        if (name == "open" or name.endswith((".open", ".read_text", ".write_text", "TextIOWrapper")))
        and not name.startswith(("os.", "av.", "Image.", "tomllib.", "archive."))
        and not any(word.arg == "encoding" for word in call.keywords)
        and not any(isinstance(mode, ast.Constant) and "b" in str(mode.value) for mode in call.args)
    ]
    assert unnamed == []


def test_logs_are_written_as_bytes() -> None:
    """A file opened by `os.open` turns line ends into two characters on Windows, unless O_BINARY is given."""
    found = {path for path, text in texts().items() if "os.open(" in text and "O_BINARY" not in text}
    assert found == {
        "hardware/drivers/device_lock.py",  # a device, to lock it
        "hardware/drivers/sysfs_backlight.py",  # Linux's
        "hardware/presentation/openxr_runtime.py",  # os.devnull, of which nothing is kept
    }


def test_no_file_has_a_name_that_windows_refuses() -> None:
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True)
    kept = [part for path in listed.stdout.split("\0") for part in path.split("/") if part]
    assert len(kept) > 1000
    assert [name for name in kept if set(name) & set('<>:"|?*\\') or name.endswith((".", " "))] == []


def test_a_player_is_ended_without_groups_of_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device_passes, "HAS_UNIX", False)
    for module in ("os", "signal"):  # with nothing in them that could be used
        monkeypatch.setattr(device_passes, module, types.SimpleNamespace())
    request = PassRequest("simulated", {"full": "100"}, 2, 1.0, 0.0, 20.0, "sleep {film}")
    bench = Bench(time.monotonic, time.sleep, None, timed=True)
    begun: list[subprocess.Popen[bytes]] = []
    popen = subprocess.Popen
    monkeypatch.setattr(subprocess, "Popen", lambda *a, **b: begun.append(popen(*a, **b)) or begun[0])
    with device_passes._started(request, "full", bench, "", input):
        assert begun[0].poll() is None
    assert begun[0].wait(60) != 0


@pytest.mark.parametrize(
    ("system", "folder"), [("win32", "AppData/Local"), ("darwin", "Library/Caches"), ("linux", ".cache")]
)
def test_what_is_kept_between_runs_lies_where_the_system_has_caches(
    system: str, folder: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    assert cache_folder() == tmp_path / folder / "evenlight"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "own"))
    assert cache_folder() == tmp_path / "own" / "evenlight"


WORKING = (
    "--help",
    "optimize sunrise --fps 0.2 --budget 0.6 --no-player --out out",
    "validate out/track.csv",
    "simulate ramp --participants 1 --design quick --out lab",
    "export lab --to bids --out bids",
)
REFUSED = (
    "follow sunrise track.csv --backlight ddc:5",
    "measure power --instrument exec:meter",
)


@pytest.fixture(scope="module")
def without(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], str, Path]:
    """What came of importing everything and of commands, on streams that take ASCII alone; the folder."""
    folder = tmp_path_factory.mktemp("without_unix")
    words = [word for line in (*WORKING, *REFUSED) for word in ("then", *line.split())]
    run = Run([str(folder), *words], dict(os.environ), SCRIPT)
    out, err = run.communicate(timeout=280)
    assert run.returncode == 0, out[-3000:] + err
    return json.loads(out.splitlines()[-1]), err, folder


@pytest.mark.slow
def test_every_module_can_be_imported_without_what_unix_alone_has(without: tuple[Any, str, Path]) -> None:
    said, _, _ = without
    assert said["failed"] == []
    assert said["count"] >= len(texts()) - 2  # the package itself, and __main__


@pytest.mark.slow
def test_the_base_works_without_it(without: tuple[Any, str, Path]) -> None:
    """A track of a sequence, a data set and its export, checks, help."""
    said, err, folder = without
    assert said["codes"][: len(WORKING)] == [0] * len(WORKING), err
    assert (folder / "out/track.csv").is_file()
    assert (folder / "bids/participants.tsv").is_file()


@pytest.mark.slow
def test_what_cannot_work_without_it_says_so_in_one_line(without: tuple[Any, str, Path]) -> None:
    said, err, _ = without
    assert set(said["codes"][len(WORKING) :]) <= {1, 2}
    assert [line for line in err.splitlines() if "works on Linux and macOS only" in line] == err.splitlines()[
        -len(REFUSED) :
    ]
    assert "Traceback" not in err
