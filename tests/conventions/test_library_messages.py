"""Errors of the library name arguments, which a command tells as its options: Python has no `--display`."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

HOUSE = Path(__file__).parents[2]
LIBRARY = ("method", "stimuli", "data_schema", "analysis", "evenlight")
# Commands, and what they alone use: another program's columns are named by options of `import`.
OF_COMMANDS = re.compile(
    r".*commands?\.py|data_schema/importing/.*|data_schema/storage/foreign_tables\.py|evenlight/cluster\.py"
)


def raised(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield the texts of raised errors, but for what stands in backticks: a command line to copy."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise) and node.exc is not None:
            parts = [part.value for part in ast.walk(node.exc) if isinstance(part, ast.Constant)]
            text = "".join(part for part in parts if isinstance(part, str))
            yield node.lineno, re.sub(r"`evenlight [^`]*`", "", text)


@pytest.mark.slow
def test_no_error_names_an_option() -> None:
    found = []
    for folder in LIBRARY:
        for path in sorted((HOUSE / folder).rglob("*.py")):
            name = path.relative_to(HOUSE).as_posix()
            if OF_COMMANDS.fullmatch(name) or path.is_symlink():
                continue
            found += [
                f"{name}:{line}: {text}"
                for line, text in raised(ast.parse(path.read_text(encoding="utf-8")))
                if re.search(r"(?<![\w-])--[a-z]", text)
            ]
    assert not found


def test_an_option_in_an_error_is_found() -> None:
    """The test above could fail."""
    (told,) = raised(
        ast.parse('raise InputError(f"{a}: give it with --rate-limit, `evenlight fit --form x`")')
    )
    assert told == (1, ": give it with --rate-limit, ")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("given", "told"),
    [
        (("--min-factor", 2), "--min-factor must lie in 0.001 to 0.99, got 2"),
        (("--solver", "slsqp", "--start", "."), "--start is for --solver splitting; slsqp starts on its own"),
        (("--robust", "--with", "a.mp4"), "--robust analyses one video by each measure; leave out --with"),
        (
            ("--display", "laptop-lcd"),
            "give it as --rate-limit, or borrow this one, unproven there, with --oth",
        ),
    ],
)
def test_a_command_tells_its_options(command: Any, tmp_path: Path, given: tuple[Any, ...], told: str) -> None:
    refused = command("optimize", "sunrise", "--budget", 0.5, "--out", tmp_path / "track", *given)
    assert refused.code == 2
    assert told in refused.err
    assert "`" not in refused.err.replace("`evenlight run ramp`", "").replace("`evenlight fit`", "")
