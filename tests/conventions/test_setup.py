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
    for name in ("sh", "dirname", "touch"):
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
esac
""",
    )


def set_up(system: Path, user: int = 1000, **variables: str) -> str:
    """The one line with which it ends."""
    program(system, "id", f"echo {user}")
    ended = subprocess.run(
        ["sh", str(system / "setup.sh")],
        env={"PATH": str(system / "bin"), **variables},
        cwd=os.sep,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
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
