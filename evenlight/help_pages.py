"""What `--help` shows: usage, commands in groups, options in panels, and two examples that can be copied.

Pages are plain text, so that they read the same on a terminal, in a pipe and in a screen reader. The group of
a command and the panel of an option are declared with them, as Typer's `rich_help_panel`.

The examples are in `help_examples.txt`, one a line, and tests run them. They use files that a reader has
(`film.mp4`, `desk.rig.toml`) and what earlier examples made (`film-track`, `lab`, `calibration`, `study`).
"""

from __future__ import annotations

import enum
import os
import shutil
import textwrap
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperArgument, TyperCommand, TyperGroup, TyperOption

WIDEST = 110  # columns: longer lines are hard to read
NAMES = 26  # columns of names; a longer one has a line of its own
GROUPS = ("Start here", "Video", "Calibration", "Experiments", "Instruments", "Statistics", "Files")
OUTPUT = "Output"  # the panel that is shown after others
GENERAL = "General"  # the panel of options that name none
VALUES = {"float": "NUMBER", "int": "N", "str": "TEXT", "path": "FILE"}  # what an option takes, by its type
NESTED = ("new", "track", "measure")  # groups of commands
TIED = "\u00a0"  # a space at which no line ends
Row = tuple[str, str]  # of a panel: a name, and what it is


class HelpfulCommand(TyperCommand):
    """A command whose `--help` is a page of this module."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the page."""
        formatter.write(help_page(self, ctx))


class HelpfulGroup(TyperGroup):
    """A group of commands whose `--help` is a page of this module."""

    format_help = HelpfulCommand.format_help


def _examples() -> dict[str, list[str]]:
    """Return the first two lines that begin with the words of each command; "" stands for all of them."""
    examples: dict[str, list[str]] = {}
    for line in Path(__file__).with_name("help_examples.txt").read_text(encoding="utf-8").splitlines():
        words = line.split()[1:3]
        for depth in (0, 1, 2) if words[0] in NESTED else (0, 1):
            examples.setdefault(" ".join(words[:depth]), []).append(line)
    return {words: lines[:2] for words, lines in examples.items()}


EXAMPLES = _examples()


def help_page(command: TyperCommand | TyperGroup, context: typer.Context) -> str:
    """Return what `--help` shows of a command, or of a group of them, as wide as the terminal."""
    width = min(shutil.get_terminal_size().columns, WIDEST)
    arguments = [one for one in command.params if isinstance(one, TyperArgument)]
    options = [one for one in command.get_params(context) if isinstance(one, TyperOption) and not one.hidden]
    needed = ["COMMAND"] if isinstance(command, TyperGroup) else []
    needed += [_argument(one) if one.required else f"[{_argument(one)}]" for one in arguments]
    needed += [_option(one, context) for one in options if one.required]
    usage = textwrap.wrap(
        " ".join(["Usage:", context.command_path, *needed, "[OPTIONS]"]),
        width,
        subsequent_indent=" " * 7,
        break_on_hyphens=False,
    )
    text = [textwrap.fill(" ".join(part.split()), width) for part in (command.help or "").split("\n\n")]
    panels = _command_panels(command) if isinstance(command, TyperGroup) else {}
    if arguments:
        panels["Arguments"] = [(_argument(one), one.help or "") for one in arguments]
    panels |= _option_panels(options, context)
    names = [name for rows in panels.values() for name, _ in rows]
    column = 4 + max((len(name) for name in names if len(name) <= NAMES), default=0)
    sections = [f"{_heading(title)}\n{_table(rows, column, width)}" for title, rows in panels.items()]
    words = context.command_path.split()
    examples = "\n".join(_example_lines(" ".join(words[words.index("evenlight") + 1 :])))
    return "\n\n".join(["\n".join(usage), *text, *sections, examples]).rstrip() + "\n"


def _command_panels(group: TyperGroup) -> dict[str, list[Row]]:
    """Return the rows of each group of commands, in the order of `GROUPS`, then others."""
    panels: dict[str, list[Row]] = {title: [] for title in GROUPS}
    for name, one in group.commands.items():
        title = getattr(one, "rich_help_panel", None) or "Commands"
        panels.setdefault(title, []).append((name, (one.help or "").split("\n\n")[0]))
    return {title: rows for title, rows in panels.items() if rows}


def _option_panels(options: Iterable[TyperOption], context: typer.Context) -> dict[str, list[Row]]:
    """Return the rows of each panel, the general one last."""
    panels: dict[str, list[Row]] = {}
    general: list[Row] = []
    for one in options:
        notes = (note.replace(" ", TIED) for note in _notes(one))
        row = (_option(one, context), " ".join([(one.help or "").strip(), *notes]).strip())
        (panels.setdefault(one.rich_help_panel, []) if one.rich_help_panel else general).append(row)
    last = {OUTPUT: panels.pop(OUTPUT)} if OUTPUT in panels else {}
    return {**panels, **last, (GENERAL if panels or last else "Options"): general}


def _argument(argument: TyperArgument) -> str:
    return (argument.metavar or argument.name or "").upper() + ("..." if argument.nargs == -1 else "")


def _option(option: TyperOption, context: typer.Context) -> str:
    """Return an option with what it takes: nothing, if it is a flag."""
    if option.is_flag:  # what undoes it is for what `--request` asks, unless it is on without
        return " / ".join([*option.opts, *(option.secondary_opts if option.default else ())])
    names = " / ".join(option.opts)
    kind = option.display_type(context).strip("<>").removesuffix(" range")
    kind = kind.removeprefix("list[").removesuffix("]")
    return f"{names} {option.metavar or VALUES.get(kind, kind)}"


def _notes(option: TyperOption) -> Iterator[str]:
    """Yield whether an option is required or repeatable, its range and its default."""
    if option.required:
        yield "[required]"
    if option.multiple:
        yield "[repeatable]"
    if option.min is not None and option.max is not None:
        yield f"[{option.min:.15g} to {option.max:.15g}]"
    default: Any = option.show_default if isinstance(option.show_default, str) else option.default
    if isinstance(default, enum.Enum):
        default = default.value
    if isinstance(default, float):
        default = f"{default:g}"
    if option.show_default and default not in (None, "", []) and not isinstance(default, bool):
        yield f"[default: {default}]"


def _heading(title: str) -> str:
    return f"{title}:" if os.environ.get("NO_COLOR") else typer.style(f"{title}:", bold=True)


def _table(rows: list[Row], column: int, width: int) -> str:
    """Return names and what they are, in two columns; the second begins at `column`."""
    lines = []
    for name, about in rows:
        begin = f"  {name}".ljust(column) if len(name) <= NAMES else f"  {name}\n{' ' * column}"
        wrapped = textwrap.wrap(about, width - column, break_on_hyphens=False)
        lines.append((begin + f"\n{' ' * column}".join(wrapped)).rstrip().replace(TIED, " "))
    return "\n".join(lines)


def _example_lines(words: str) -> Iterator[str]:
    """Yield the examples of a command, each below what it is for; they are never wrapped, to be copied."""
    if words in EXAMPLES:
        yield _heading("Examples")
        for example in EXAMPLES[words]:
            line, _, comment = example.partition("  # ")
            yield from (f"  # {comment}", f"  {line.rstrip()}")
