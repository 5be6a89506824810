"""`setup.sh` says what is missing, on systems that are not as it needs them."""

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import evenlight

SETUP = Path(evenlight.__file__).parents[1] / "setup.sh"


@pytest.fixture
def system(tmp_path: Path) -> Path:
    """A folder with `setup.sh`, and a `bin` with nothing but what any system has."""
    tools = tmp_path / "bin"
    tools.mkdir()
    for name in ("sh", "dirname", "touch", "grep", "mkdir", "rm", "cp", "cat", "sed"):
        found = shutil.which(name)
        assert found is not None
        (tools / name).symlink_to(found)
    shutil.copy(SETUP, tmp_path / "setup.sh")
    return tmp_path


def program(system: Path, name: str, script: str) -> None:
    path = system / "bin" / name
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)


ASKED = 'echo "$*" >>asked_of_pip'


# Another version of Python, with or without venv, as far as a line of it can tell.
PRETENDED = """
import sys, types
sys.version_info = (*map(int, "{version}".split(".")), 1, "final", 0)
sys.modules["ensurepip"] = types.ModuleType("ensurepip") if {has_venv} else None
exec(sys.argv[1])
"""


def python(system: Path, name: str, version: str, has_venv: bool = True, pip: str = ASKED) -> None:
    """A Python of some version: what is asked with -c is answered, pip and venv are told only."""
    pretended = shlex.quote(PRETENDED.format(version=version, has_venv=has_venv))
    program(
        system,
        name,
        f"""
case "$*" in
    --version) echo "Python {version}.1" ;;
    "-c "*) exec {shlex.quote(sys.executable)} -I -S -c {pretended} "$2" ;;
    "-m venv "*) [ "$3" != --clear ] || rm -rf .venv; mkdir -p .venv/bin && cp "$0" .venv/bin/python ;;
    *"pip install"*) {pip} ;;
    "-P -c import evenlight") ;;
    "-m evenlight.compile_kernels") echo compiled >compiled ;;
    *) echo "what is $*?" >&2; exit 70 ;;
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
    assert "needs Python 3.11 to 3.14, and there is no python3 here" in set_up(system)


@pytest.mark.parametrize("version", ["3.10", "3.15"])
@pytest.mark.parametrize("user", [0, 1000])
def test_a_system_whose_python_is_another(system: Path, version: str, user: int) -> None:
    """The system's `python3`, installed once more, would be the same."""
    python(system, "python3", version)
    program(system, "apt-get", 'case "$*" in *python3.1*) exit 100 ;; esac; [ "$1" = update ]')
    line = set_up(system, user)
    assert f"needs Python 3.11 to 3.14, and python3 here is Python {version}.1: install one beside it" in line
    assert "make setup PYTHON=/path/to/python3.12" in line


@pytest.mark.parametrize("version", ["3.13", "3.14"])
def test_newer_pythons_do_for_all_but_psychopy(system: Path, version: str) -> None:
    """Debian 13 has Python 3.13 and no other."""
    python(system, "python3", version)
    assert run_setup(system, "", 1000).returncode == 0
    tests = run_setup(system, "test", 1000)
    assert tests.returncode == 0
    assert "the tests of sessions in a window will be skipped" in tests.stdout
    assert not (system / ".venv" / ".lab-ready").exists()
    lab = run_setup(system, "lab", 1000)
    assert (lab.returncode, lab.stderr.count("\n")) == (1, 1)
    assert f"needs Python 3.11 or 3.12 for PsychoPy, and python3 here is Python {version}.1" in lab.stderr
    assert "make lab PYTHON=/path/to/python3.12" in lab.stderr


def test_lab_makes_the_environment_anew_with_a_python_that_was_installed_since(system: Path) -> None:
    python(system, "python3", "3.13")
    assert run_setup(system, "", 1000).returncode == 0
    python(system, "python3.12", "3.12")
    lab = run_setup(system, "lab", 1000)
    assert lab.returncode == 0
    assert "is made anew" in lab.stdout
    assert "Python 3.12.1" in (system / ".venv" / "bin" / "python").read_text()
    assert (system / ".venv" / ".lab-ready").exists()


def test_each_step_is_said_and_how_to_start(system: Path) -> None:
    python(system, "python3.12", "3.12")
    steps = run_setup(system, "", 1000).stdout.splitlines()
    told = (
        "making .venv with Python 3.12.1",
        "installing its packages",
        "compiling its loops",
        "ready; start",
    )
    assert [step in line for step, line in zip(told, steps, strict=True)] == [True] * 4
    assert ".venv/bin/evenlight demo" in steps[-1]
    assert ". .venv/bin/activate" in steps[-1]
    assert (system / "compiled").exists()


RETRYING = "WARNING: Retrying (Retry(total=4)) after connection broken by 'NewConnectionError'"
NONE_FITS = (
    "ERROR: Could not find a version that satisfies the requirement setuptools>=77 (from versions: none)"
)
CONFLICT = (
    "ERROR: Cannot install setuptools>=77 because these package versions have conflicting dependencies."
)
IMPOSSIBLE = "ERROR: ResolutionImpossible: for help visit the pages of pip"
NONE_FOUND = "ERROR: No matching distribution found for setuptools>=77"
CUT_OFF = "pip._vendor.urllib3.exceptions.ReadTimeoutError: Read timed out."


def fails_with(*said: str) -> str:
    """A script that fails as pip does, saying this."""
    return "; ".join([*(f'echo "{line}" >&2' for line in said), "exit 1"])


@pytest.mark.parametrize(
    ("said", "reason"),
    [
        ((RETRYING, f"      {NONE_FITS}", f"      {NONE_FOUND}"), f" ({NONE_FITS.removeprefix('ERROR: ')})"),
        ((NONE_FITS, NONE_FOUND), f" ({NONE_FITS.removeprefix('ERROR: ')})"),
        ((f"      {CONFLICT}", f"      {IMPOSSIBLE}"), f" ({CONFLICT.removeprefix('ERROR: ')})"),
        (("Traceback", CUT_OFF), ""),
    ],
)
def test_without_a_network_one_line_says_so(system: Path, said: tuple[str, ...], reason: str) -> None:
    """Or where the index has nothing for this Python: pip tells no difference, so its own words are given."""
    python(system, "python3", "3.11", pip=fails_with(*said))
    ended = run_setup(system, "", 1000)
    assert (ended.returncode, ended.stderr.count("\n")) == (1, 1)
    assert f"packages could not be fetched{reason}: this needs a network, or PIP_INDEX_URL" in ended.stderr
    assert "has them for Python 3.11.1" in ended.stderr
    assert (system / ".venv" / "pip.log").read_text().splitlines() == list(said)
    assert not (system / ".venv" / ".ready").exists()


def test_what_else_pip_says_is_shown(system: Path) -> None:
    """A package that does not build is no fault of the network, even if that stumbled on the way."""
    python(system, "python3", "3.11", pip=fails_with(RETRYING, "ERROR: Failed building wheel for pyglet"))
    ended = run_setup(system, "", 1000)
    assert ended.returncode == 1
    assert ended.stderr.startswith(f"{RETRYING}\nERROR: Failed")
    assert (
        "evenlight: pip could not install Evenlight: Failed building wheel for pyglet; above" in ended.stderr
    )


def test_why_apt_refuses_is_said(system: Path) -> None:
    program(system, "apt-get", 'echo "E: Unable to fetch some archives" >&2; exit 100')
    ended = run_setup(system, "", user=0)
    assert ended.returncode == 1
    assert "there is no python3 here (apt-get: Unable to fetch some archives): install one" in ended.stderr
    assert "asking apt-get for python3.12" in ended.stdout


def set_up_for_sessions(system: Path) -> Path:
    """A checkout in which `make lab` has run, long after its files were written; its Python."""
    shutil.copy(SETUP.with_name("Makefile"), system)
    (system / "requirements").mkdir()
    for name in ("setup.sh", "Makefile", "pyproject.toml", "requirements/base.txt"):
        (system / name).touch()
        os.utime(system / name, (0, 0))
    python(system, "python3", "3.12")
    assert run_setup(system, "lab", 1000).returncode == 0
    return system / ".venv" / "bin" / "python"


@pytest.mark.parametrize("gone", ["dangling", "replaced"])
def test_an_environment_whose_python_is_gone_is_made_anew(system: Path, gone: str) -> None:
    """By an upgrade of the system: the link leads nowhere, or to a Python that has none of the packages."""
    own = set_up_for_sessions(system)

    def asked() -> str:
        return subprocess.run(
            ["make", "-n", "lab"], cwd=system, capture_output=True, text=True, check=True
        ).stdout

    assert "Nothing to be done for 'lab'" in asked()
    own.unlink()
    if gone == "dangling":
        own.symlink_to("/nonexistent/python3")
    else:
        own.write_text("#!/bin/sh\nexit 1\n")
        own.chmod(0o755)
    assert "./setup.sh lab" in asked()
    ended = run_setup(system, "", 1000)
    assert (ended.returncode, "is made anew" in ended.stdout) == (0, True)
    assert (system / ".venv" / ".ready").exists()
    assert not (system / ".venv" / ".lab-ready").exists()


def test_a_python_that_was_named_too_late_is_said_not_to_be_used(system: Path) -> None:
    python(system, "python3", "3.12")
    assert run_setup(system, "", 1000).returncode == 0
    python(system, "python3.11", "3.11")
    assert (
        "PYTHON is not used: .venv has Python 3.12.1"
        in run_setup(system, "", 1000, PYTHON="python3.11").stdout
    )
    assert "not used" not in run_setup(system, "", 1000, PYTHON="python3").stdout


def test_a_mode_that_is_none_is_refused(system: Path) -> None:
    python(system, "python3", "3.11")
    ended = run_setup(system, "labb", 1000)
    assert (ended.returncode, ended.stderr.count("\n")) == (1, 1)
    assert "no mode labb" in ended.stderr


def test_a_python_that_was_named_is_not_replaced_by_another(system: Path) -> None:
    python(system, "python3", "3.12")
    line = set_up(system, PYTHON="/nonexistent")
    assert "PYTHON=/nonexistent is no Python 3.11 to 3.14" in line


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
    ("mode", "needed", "left_out", "files", "marks"),
    [
        ("", set(), WINDOWS | PAGES_AND_PLAYERS, "", {".ready"}),
        ("lab", WINDOWS, PAGES_AND_PLAYERS, "lab", {".ready", ".lab-ready"}),
        (
            "test",
            WINDOWS | PAGES_AND_PLAYERS,
            set(),
            "docs dev lab",
            {".ready", ".lab-ready", ".test-ready", ".docs-ready", ".dev-ready"},
        ),
        ("docs", set(), WINDOWS | PAGES_AND_PLAYERS, "docs", {".ready", ".docs-ready"}),
        ("dev", set(), WINDOWS | PAGES_AND_PLAYERS, "docs dev", {".ready", ".docs-ready", ".dev-ready"}),
    ],
)
def test_each_mode_asks_for_its_packages(
    system: Path, mode: str, needed: set[str], left_out: set[str], files: str, marks: set[str]
) -> None:
    debian(system)
    ended = run_setup(system, mode, user=0)
    assert (ended.returncode, ended.stderr) == (0, "")
    asked = system / "asked_of_apt"
    packages = set(asked.read_text().split()) if asked.exists() else set()
    assert needed <= packages
    assert not packages & left_out
    *fetched, own = (system / "asked_of_pip").read_text().splitlines()
    assert own.endswith(" --editable .")
    assert "--no-deps" in own  # all that it needs was fetched before
    assert [line.split()[-1] for line in fetched] == [
        f"requirements/{name}.txt" for name in ("build", "base", *files.split())
    ]
    # Each with its hash, and built with nothing but what was fetched so.
    assert all({"--require-hashes", "--no-build-isolation"} <= set(line.split()) for line in fetched)
    assert {path.name for path in (system / ".venv").iterdir()} == {"bin", "pip.log", *marks}


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
