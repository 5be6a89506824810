"""Options of commands: panels in `--help`, words that a shell completes, records whose fields they are.

A command declares an option with its panel, as `asked("--budget", help=...)`; `--help` is in none. Nothing
here is slow to import: a shell waits for the words.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable
from functools import partial, wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args, get_type_hints

import typer

asked = partial(typer.Option, rich_help_panel="What is asked")
viewing = partial(typer.Option, rich_help_panel="Display and viewing")
limits = partial(typer.Option, rich_help_panel="Rate limit")
computation = partial(typer.Option, rich_help_panel="Computation")
instruments = partial(typer.Option, rich_help_panel="Instrument")
output = partial(typer.Option, rich_help_panel="Output")
expert = partial(typer.Option, hidden=True)  # in docs/requests.md, and a key of request.toml
# Of all commands, so that the help of `evenlight` tells it once.
QuietOption = Annotated[
    bool, typer.Option("--quiet", hidden=True, help="Print no progress and no closing lines.")
]
PreregisteredOption = Annotated[
    Path | None,
    expert(
        metavar="FILE",
        help="A pre-registration of `plan`, with which the run is compared. Otherwise those in the data set.",
    ),
]
ForceOption = Annotated[
    bool,
    typer.Option(
        "--force", hidden=True, help="Remove what else lies in the folder of results, where it is refused."
    ),
]

Complete = Callable[[str], list[str]]
PACKAGE = Path(__file__).parent
Returned = TypeVar("Returned")


def words_and_files(*words: str, ending: str = "") -> Complete:
    """Return what completes some words, or a file of the current folder, of one ending if that is given.

    Where no word fits, nothing is returned, and the shell completes the name of a file by itself.
    """

    def complete(incomplete: str) -> list[str]:
        fitting = [word for word in words if word.startswith(incomplete)]
        if not fitting:
            return []
        files = [f"{path.name}/" if path.is_dir() else path.name for path in Path().glob("[!.]*")]
        return fitting + sorted(
            name for name in files if name.startswith(incomplete) and name.endswith((ending, "/"))
        )

    return complete


def presets_and_files(folder: str, ending: str) -> Complete:
    """Return what completes the presets that lie in a folder of the package, or files."""

    def complete(incomplete: str) -> list[str]:
        found = sorted({path.name.partition(".")[0] for path in (PACKAGE / folder).glob(f"*{ending}")})
        return words_and_files(*found, ending=Path(ending).suffix)(incomplete)

    return complete


complete_display = presets_and_files("method/presets", ".display.toml")
complete_power_model = presets_and_files("method/presets", ".power.toml")
complete_rate_limit = presets_and_files("method/presets", ".rate_limit.json")
complete_rig = presets_and_files("hardware/rigs", ".rig.toml")
complete_design = presets_and_files("experiments/designs", ".design.toml")
complete_video = words_and_files(
    "library", "gym", "living_room", "basement", "house", "checkerboard", "sunrise"
)

# The one name of what other programs, or earlier versions, call otherwise.
RIGHT_NAMES = {
    "lowest_factor": "min_factor",
    "minimum_factor": "min_factor",
    "frames_per_second": "fps",
    "frame_rate": "fps",
    "battery": "battery_wh",
    "measure": "measures",
}
# Options of earlier versions, and why they are gone.
GONE = {
    "tolerance": "it is gone: every frame is counted whole",
    **dict.fromkeys(("progress", "quiet"), "in Python, evenlight.progress.in_notebooks = False turns it off"),
    **dict.fromkeys(("tune", "sweep"), "gains are tuned in a checkout, by python -m benchmarks.tune_gains"),
    "walk": "a walk is a command of its own, `evenlight walk SCENE`",
    "measure_power": "it is a command of its own, `evenlight measure played VIDEO TRACK`",
    "tuning": "it is gone: give its gains by --proportional, --integral, --derivative, --gain-rate",
}

# What an option or argument takes, and what completes it, by its name; a command may say otherwise.
METAVARS = {
    "budget": "B",
    "design": "NAME|FILE",
    "display": "NAME|FILE",
    "field_of_view": "DEGREES",
    "figures": "svg|pdf",
    "figure_style": "FILE",
    "fps": "HZ",
    "horizon": "SECONDS",
    "instrument": "DRIVER:ADDRESS",
    "interval_s": "SECONDS",
    "out": "DIR",
    "participant": "ID",
    "power_model": "NAME|FILE",
    "rate_hz": "HZ",
    "rate_limit": "NAME|FILE",
    "rig": "NAME|FILE",
    "seconds": "SECONDS",
    "session": "ID",
    "stimuli": "DIR",
    "target_loss": "LOSS",
}
COMPLETIONS = {
    "clip": complete_video,
    "design": complete_design,
    "display": complete_display,
    "power_model": complete_power_model,
    "rate_limit": complete_rate_limit,
    "rig": complete_rig,
    "sequence": complete_video,
    "video": complete_video,
}


def declared_by_name(command: Callable[..., Any]) -> Signature:
    """Return the signature of a command; what its options take is filled in by their names."""
    declared = signature(command, eval_str=True)
    for name, parameter in declared.parameters.items():
        for one in get_args(parameter.annotation)[1:]:
            one.metavar = one.metavar or METAVARS.get(name)
            one.autocompletion = one.autocompletion or COMPLETIONS.get(name)
    return declared


def _in_panel(kind: Any, group: type[Any], name: str) -> Any:
    """Return the option of a field, in the panel of its group where another record declares it."""
    if not hasattr(group, "PANEL") or name in group.__annotations__:
        return kind
    of, option = get_args(kind)
    option = copy.copy(option)
    option.rich_help_panel = group.PANEL
    return Annotated[of, option]


def added(name: str, kind: Any, option: Any) -> Parameter:
    """Return an option that a command gets beside its own, and may go without."""
    return Parameter(name, Parameter.KEYWORD_ONLY, default=None, annotation=Annotated[kind | None, option])


def with_options(command: Callable[..., Returned], *groups: type[Any]) -> Callable[..., Returned]:
    """Return a command that takes records of options as one that takes their fields, as Typer wants it.

    Parameters
    ----------
    command : callable
        Takes a record of each group.
    *groups : type
        The records.
    """
    hints = [get_type_hints(group, include_extras=True) for group in groups]
    empty = Parameter.empty
    parameters = [
        Parameter(
            field.name,
            Parameter.KEYWORD_ONLY,
            default=empty if field.default is dataclasses.MISSING else field.default,
            annotation=_in_panel(kinds[field.name], group, field.name),
        )
        for group, kinds in zip(groups, hints, strict=True)
        for field in dataclasses.fields(group)
    ]

    @wraps(command)
    def flat(**given: Any) -> Returned:
        return command(
            *(group(**{name: given[name] for name in group.__dataclass_fields__}) for group in groups)
        )

    flat.__signature__ = Signature(parameters)  # type: ignore[attr-defined] # inspect looks for it
    flat.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    del flat.__wrapped__  # else its parameters would be looked at
    return flat
