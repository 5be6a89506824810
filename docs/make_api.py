"""Writes docs/api.md from the docstrings, and what `--help` does not show into docs/requests.md."""

from __future__ import annotations

import dataclasses
import enum
import inspect
import re
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperGroup

import evenlight
from evenlight import choices
from evenlight.analysis.results import Result
from evenlight.command import app

PAGE = Path(__file__).with_name("api.md")
REQUESTS = Path(__file__).with_name("requests.md")
GROUPS = {
    "What goes in": (
        "open_video", "Frame", "load_display", "load_power_model", "load_rate_limit", "Display", "PowerModel",
        "PanelKind", "RateLimit", "RateLimitForm", "BudgetUnit", "Actuator",
    ),
    "A brightness track": ("optimize", "Track", "load", "loss_curves", "LossCurves", "frame_loss"),
    "Online": ("OnlineController",),
    "Data": ("fit_ramps", "RampFit", "analyze", "Analysis", "figures_as"),
    "Tasks of your own": ("register_task", "TaskDeclaration"),
    "Drivers of your own": (
        "Driver", "LuminanceMeter", "PowerMeter", "Backlight", "Reading", "PowerSample",
        "ClockPing", "InstrumentError", "Fault", "ContextDevice", "SerialLink", "LineSettings",
        "restore_and_release",
    ),
    "Errors": ("InputError",),
}  # fmt: skip
# What a kind of result says for `plot`, `summary` and `save`, which people call.
SUPPLIED = ("heading", "first_lines", "figures", "write", "write_numbers")
HEAD = """# The Python interface

`import evenlight` gives these names; each is loaded when it is first used. Quantities are in cd/m², s, Hz, W,
degrees and cycles per degree; arrays are NumPy's, tables are pandas'. Bad input raises `InputError`, with one
line that says what was wrong, what was got, and what would be right. Scripts that use it stand in
[examples/](../examples/). To try things, `evenlight.samples` makes a `clip()`, and simulated tables
`ramps()`, `ratings()`, `comparisons()` and `searches()`. In a notebook long calls show a bar under their
cell; `evenlight.progress.in_notebooks = False` turns it off. This page is generated from the docstrings
(`python docs/make_api.py`).
"""


def page() -> str:
    """Return the page."""
    missing = set(evenlight.__all__) ^ {name for names in GROUPS.values() for name in names}
    assert not missing, f"names in one of evenlight.__all__ and docs/make_api.py only: {sorted(missing)}"
    parts = [HEAD]
    for title, names in GROUPS.items():
        parts.append(f"## {title}\n")
        parts += [_entry(name, getattr(evenlight, name)) for name in names]
    parts.append('## Choices, in `evenlight.choices`\n\nA value, such as `"safe"`, does as well.\n')
    parts += [
        _entry(name, getattr(choices, name)) for name in choices.__all__ if name not in evenlight.__all__
    ]
    return "\n".join(parts)


def _entry(name: str, thing: Any) -> str:
    """Return what is said of a function or a class."""
    is_record = dataclasses.is_dataclass(thing)
    described = is_record and (bool(_fields(thing)) or "Attributes" in thing.__doc__)
    by_name = inspect.isclass(thing) and (
        issubclass(thing, Exception | enum.Enum) or getattr(thing, "_is_protocol", False)
    )
    shown = name if described or by_name else _signature(name, thing)
    if is_record:
        shown = shown.replace("'", '"')
    parts = [f"### `{name}`\n", f"```python\n{shown}\n```\n" if shown != name else "", _text(thing)]
    if is_record:
        parts.append(_fields(thing))
    if inspect.isclass(thing) and issubclass(thing, enum.Enum):
        parts.append(_members(thing))
    if inspect.isclass(thing) and not issubclass(thing, Exception):
        ours = [c for c in inspect.getmro(thing) if c.__module__.startswith("evenlight.")]
        members = {name: member for c in reversed(ours) for name, member in vars(c).items()}
        own = [
            (n, m)
            for n, m in members.items()
            if not n.startswith("_") and _documented(m) and not (issubclass(thing, Result) and n in SUPPLIED)
        ]
        for method, member in own:
            if isinstance(member, property):
                parts.append(f"**`.{method}`**: {_text(member.fget)}")
            else:
                parts.append(f"**`.{_signature(method, member)}`**: {_text(member)}")
    return "\n".join(part for part in parts if part)


def _members(choice: type[enum.Enum]) -> str:
    """Return the values of an enum, with the comments that stand beside them."""
    source = inspect.getsource(choice)
    rows = []
    for name, member in choice.__members__.items():
        comment = re.search(rf"^    {name} = [^#\n]*  # (.*)$", source, re.MULTILINE)
        rows.append(f'- `{name}`, `"{member.value}"`{f": {comment[1]}" if comment else ""}')
    return "\n".join(rows) + "\n"


def _documented(member: Any) -> bool:
    """Return whether a member of a class is a method or property with a docstring."""
    found = member.fget if isinstance(member, property) else member
    return inspect.isfunction(found) and bool(found.__doc__)


def _signature(name: str, thing: Any) -> str:
    """Return the call with its arguments, without types: those stand in the docstring."""
    signature = inspect.signature(thing)
    plain = [p.replace(annotation=p.empty) for p in signature.parameters.values() if p.name != "self"]
    text = name + str(signature.replace(parameters=plain, return_annotation=signature.empty)).replace(
        "'", '"'
    )
    if len(text) <= 100:
        return text
    arguments = str(signature.replace(parameters=plain, return_annotation=signature.empty))[1:-1]
    return f"{name}(\n    " + ",\n    ".join(re.split(r", (?![^()]*\))", arguments)) + ",\n)"


def _fields(record: Any) -> str:
    """Return the fields of a record, with the unit and the words that are declared with each."""
    rows = ["| field | unit | meaning |", "|---|---|---|"]
    for field in dataclasses.fields(record):
        doc, unit = field.metadata.get("doc"), field.metadata.get("unit", "")
        if doc:
            rows.append(f"| `{field.name}` | {unit if unit != '1' else ''} | {doc} |")
    return "\n".join(rows) + "\n" if len(rows) > 2 else ""


def _text(thing: Any) -> str:
    """Return a numpy docstring as Markdown."""
    lines = inspect.cleandoc(thing.__doc__ or "").splitlines()
    out: list[str] = []
    section = ""
    for number, line in enumerate(lines):
        if set(line) == {"-"} and len(line) > 2:
            continue
        if number + 1 < len(lines) and set(lines[number + 1]) == {"-"} and len(lines[number + 1]) > 2:
            section = line
            out += ["", f"*{line}*", ""]
        elif line.startswith((">>>", "...")) or (out and out[-1].startswith("    >>>") and line):
            section = "Examples"
            out.append(f"    {line}")
        elif section in ("Parameters", "Attributes", "Returns", "Raises") and line:
            out.append(f"  {line.strip()}" if line.startswith(" ") else f"- `{line}`  ")
        else:
            out.append(line)
    return re.sub(r"\n{3,}", "\n\n", "\n".join(out)).strip() + "\n"


def requests_page() -> str:
    """Return the page on requests; what stands before its table is written by hand."""
    written = REQUESTS.read_text().partition("\n| option ")[0].rstrip()
    commands: dict[tuple[str, str, str], list[str]] = {}  # by what is said of an option
    for command, said in _hidden(typer.main.get_command(app), ()):
        commands.setdefault(said, []).append(command)
    rows = ["| option | of | what it is | default |", "|---|---|---|---|"]
    for (name, words, default), names in commands.items():
        rows.append(f"| `{name}` | {', '.join(names)} | {words} | {default} |")
    return "\n\n".join([written, "\n".join(rows)]) + "\n"


def _hidden(command: Any, words: tuple[str, ...]) -> list[tuple[str, tuple[str, str, str]]]:
    """Return the options that the help of commands does not show: command; name, what it is, default."""
    if isinstance(command, TyperGroup):
        return [part for name, one in command.commands.items() for part in _hidden(one, (*words, name))]
    found = []
    for one in command.params:
        if getattr(one, "hidden", False) and one.name != "quiet":  # which the page tells of in words
            told = one.show_default if isinstance(one.show_default, str) else one.default
            default = getattr(told, "value", told)
            shown = f"`{default}`" if default not in (None, False) else ""
            found.append((" ".join(words), (one.opts[0], one.help, shown)))
    return found


if __name__ == "__main__":
    PAGE.write_text(page())
    REQUESTS.write_text(requests_page())
