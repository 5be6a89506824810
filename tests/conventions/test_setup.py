"""`setup.sh` says what is missing, on systems that are not as it needs them."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

import evenlight

SETUP = Path(evenlight.__file__).parents[1] / "setup.sh"


@pytest.fixture
def system(tmp_path: Path) -> Path:
    """A folder with `setup.sh`, and a `bin` with nothing but what any system has."""
    tools = tmp_path / "bin"
    tools.mkdir()
    for name in ("sh", "dirname", "touch", "grep", "mkdir", "cp"):
        found = shutil.which(name)
        assert found is not None
        (tools / name).symlink_to(found)
    shutil.copy(SETUP, tmp_path / "setup.sh")
    return tmp_path


def program(system: Path, name: str, script: str) -> None:
    path = system / "bin" / name
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)


def python(system: Path, name: str, version: str, has_venv: bool = True) -> None:
    """A Python of some version, as far as `setup.sh` asks."""
    program(
        system,
        name,
        f"""
case "$*" in
    --version) echo "Python {version}.1" ;;
    *"sys.exit(not (3, 11)"*) case {version} in 3.11|3.12) exit 0 ;; *) exit 1 ;; esac ;;
    *"print("*) echo python{version}-venv ;;
    *ensurepip*) exit {0 if has_venv else 1} ;;
    "-m venv "*) mkdir -p .venv/bin && cp "$0" .venv/bin/python ;;
    *"pip install"*) echo "$*" >asked_of_pip ;;
esac
""",
    )


def run_setup(system: Path, mode: str, user: int, **variables: str) -> subprocess.CompletedProcess[str]:
    program(system, "id", f"echo {user}")
    return subprocess.run(
        ["sh", str(system / "setup.sh"), *filter(None, [mode])],
        env={"PATH": str(system / "bin"), **variables},
        cwd=os.sep,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


def set_up(system: Path, user: int = 1000, **variables: str) -> str:
    """The one line with which it ends."""
    ended = run_setup(system, "", user, **variables)
    assert ended.returncode == 1
    assert ended.stderr.count("\n") == 1
    assert not (system / ".venv").exists()
    return ended.stderr


def test_no_python_at_all(system: Path) -> None:
    assert "needs Python 3.11 or 3.12, and there is no python3 here" in set_up(system)


@pytest.mark.parametrize("version", ["3.10", "3.13"])
@pytest.mark.parametrize("user", [0, 1000])
def test_a_system_whose_python_is_another(system: Path, version: str, user: int) -> None:
    """Debian 13 has 3.13 and no other; its `python3`, installed once more, would be the same."""
    python(system, "python3", version)
    program(system, "apt-get", 'case "$*" in *python3.1*) exit 100 ;; esac; [ "$1" = update ]')
    line = set_up(system, user)
    assert f"needs Python 3.11 or 3.12, and python3 here is Python {version}.1: install one beside it" in line
    assert "PYTHON=/path/to/python3.12" in line


def test_a_python_that_was_named_is_not_replaced_by_another(system: Path) -> None:
    python(system, "python3", "3.12")
    line = set_up(system, PYTHON="/nonexistent")
    assert "PYTHON=/nonexistent is no Python 3.11 or 3.12" in line


@pytest.mark.parametrize("user", [0, 1000])
def test_a_python_without_venv(system: Path, user: int) -> None:
    python(system, "python3", "3.12", has_venv=False)
    assert "Python's venv is missing: install it (python3.12-venv on Debian and Ubuntu)" in set_up(
        system, user
    )


WINDOWS = {"xvfb", "libgl1", "libgl1-mesa-dri", "libegl1", "libxtst6"}  # some of what a window needs
PAGES_AND_PLAYERS = {"chromium", "chromium-driver", "mpv", "ffmpeg"}


def debian(system: Path, installed: str = "none") -> None:
    """A Debian that has one package, as far as `setup.sh` asks; it keeps what is installed."""
    python(system, "python3.12", "3.12")
    program(system, "dpkg-query", f'case "$*" in *" {installed} "*) echo "install ok installed" ;; esac')
    program(system, "apt-get", '[ "$1" = update ] || echo "$*" >>asked_of_apt')


@pytest.mark.parametrize(
    ("mode", "needed", "left_out", "extras", "marks"),
    [
        ("", set(), WINDOWS | PAGES_AND_PLAYERS, ".[dev]", {".ready"}),
        ("lab", WINDOWS, PAGES_AND_PLAYERS, ".[dev,lab]", {".ready", ".lab-ready"}),
        ("test", WINDOWS | PAGES_AND_PLAYERS, set(), ".[dev,lab]", {".ready", ".lab-ready", ".test-ready"}),
    ],
)
def test_each_mode_asks_for_its_packages(
    system: Path, mode: str, needed: set[str], left_out: set[str], extras: str, marks: set[str]
) -> None:
    debian(system)
    ended = run_setup(system, mode, user=0)
    assert (ended.returncode, ended.stderr) == (0, "")
    asked = system / "asked_of_apt"
    packages = set(asked.read_text().split()) if asked.exists() else set()
    assert needed <= packages
    assert not packages & left_out
    assert (system / "asked_of_pip").read_text().split()[-1] == extras
    assert {path.name for path in (system / ".venv").iterdir()} == {"bin", *marks}


def test_who_may_not_install_is_told_what_is_missing_and_what_is_there_is_not_asked_for(
    system: Path,
) -> None:
    debian(system, installed="mpv")
    ended = run_setup(system, "test", user=1000)
    assert ended.returncode == 0
    assert ended.stderr.count("\n") == 1
    told = set(ended.stderr.partition("apt-get install ")[2].split())
    assert WINDOWS | PAGES_AND_PLAYERS - {"mpv"} <= told
    assert "mpv" not in told
    assert not (system / "asked_of_apt").exists()
