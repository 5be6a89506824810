"""The house keeps its own rules: layers, lint, types, and documents that tell the truth."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import typer

import evenlight
from evenlight import command as command_line

ROOT = Path(evenlight.__file__).parents[1]
FOLDERS = ("data_schema", "method", "hardware", "stimuli", "experiments", "analysis")
BIN = Path(sys.executable).parent


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        [str(BIN / "ruff"), "format", "--check", "."],
        [str(BIN / "ruff"), "check", "."],
        [str(BIN / "lint-imports")],
        [str(BIN / "mypy")],
    ],
    ids=["format", "lint", "layers", "types"],
)
def test_the_checks_of_make_check_pass(command: list[str]) -> None:
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=280, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


def command_names() -> set[str]:
    group = typer.main.get_command(command_line.app)
    return set(group.commands)


def test_the_documents_list_exactly_the_commands_there_are() -> None:
    table = (ROOT / "docs" / "commands.md").read_text()
    listed = set(re.findall(r"^\| `evenlight ([a-z-]+)", table, flags=re.MULTILINE))
    assert listed == command_names()


@pytest.mark.slow
def test_every_command_helps_within_its_own_words(command) -> None:
    for name in sorted(command_names()):
        result = command(name, "--help")
        assert result.code == 0
        assert "--quiet" in result.out or name in ("validate", "watch", "new")


@pytest.mark.parametrize(
    "pattern", ["*.md", "docs/**/*.md", "*.toml", "[a-z]*/*.py", "[a-z]*/schemas/*.json"]
)
def test_nothing_promises_that_a_change_cannot_be_noticed(pattern: str) -> None:
    """The rate limit is what the median participant, watching for it, notices in 75 % of the trials."""
    promise = re.compile(
        r"undetectabl|imperceptibl|unnotic|nobody sees the brightness|goes unseen|change unseen"
    )
    files = [path for path in ROOT.glob(pattern) if path.name != Path(__file__).name]
    assert files
    for path in files:
        assert not promise.search(path.read_text()), path


def test_the_folders_of_the_house_plan_are_the_packages() -> None:
    configured = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["package-dir"]
    assert set(configured.values()) == set(FOLDERS)
    house = (ROOT / "docs" / "house.md").read_text()
    for package in FOLDERS:
        assert f"`{package}/`" in house
        assert (ROOT / package / "__init__.py").exists()


def test_no_module_has_a_name_that_says_nothing() -> None:
    empty = {"utils", "util", "helpers", "helper", "common", "core", "base", "misc"}
    names = [path.stem for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")]
    assert len(names) > 50
    assert not empty & set(names)
    assert not {name for name in names if name in sys.stdlib_module_names}


@pytest.mark.parametrize(
    "page", sorted((ROOT / "docs" / "decisions").glob("*.md")), ids=lambda page: page.stem
)
def test_a_decision_fits_on_a_screen(page: Path) -> None:
    assert len(page.read_text().split()) <= 500


def test_the_end_of_a_run_says_what_failed_and_why_something_was_skipped(pytestconfig: pytest.Config) -> None:
    """Of pytest's -r: f failed, E ended in an error, s skipped."""
    assert set("fEs") <= set(pytestconfig.option.reportchars)
