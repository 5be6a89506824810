"""Evenlight's one command: it mounts the commands of the folders, and turns input errors into one line."""

from __future__ import annotations

import functools
import gc
import io
import itertools
import logging
import os
import re
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from inspect import signature
from typing import TYPE_CHECKING, Annotated, Any, NoReturn, cast

import typer

from evenlight import bench_command, displays_command, progress
from evenlight.analysis import (
    analyze_command,
    catalogue_command,
    control_command,
    demo_command,
    fit_commands,
    judge_command,
    measuring_commands,
    optimize_command,
    plan_command,
    reproduce_command,
)
from evenlight.data_schema.checking import validate_command
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.export import export_command
from evenlight.data_schema.importing import import_command
from evenlight.data_schema.printed import printed_streams
from evenlight.data_schema.quantities import require_computable
from evenlight.data_schema.storage.input_sizes import LARGE_OK
from evenlight.experiments import new_command, play_command, watch_command
from evenlight.experiments import simulate_command as experiment_commands
from evenlight.experiments.desktop import live_command
from evenlight.experiments.follow import follow_command
from evenlight.hardware import measure_command
from evenlight.hardware.protocols import InstrumentError
from evenlight.help_pages import HelpfulCommand, HelpfulGroup
from evenlight.option_panels import GONE, RIGHT_NAMES, added, declared_by_name, expert
from evenlight.registered_tasks import load_tasks
from evenlight.result_requests import ANY_SIZE, kinds_in_file, problems_in, recorded, told_as_given
from evenlight.stimuli import apply_command, track_command
from evenlight.stimuli import commands as stimuli_commands

if TYPE_CHECKING:
    from evenlight.data_schema.display import Display
    from evenlight.data_schema.result_request import ResultRequest

app = typer.Typer(
    name="evenlight", cls=HelpfulGroup, pretty_exceptions_enable=False, rich_markup_mode=None,
    context_settings={"help_option_names": ["--help", "-h"]},
)  # fmt: skip

INTERRUPTED, TERMINATED = 130, 143  # as shells count: 128 and the number of the signal
STOPPED = {INTERRUPTED: "interrupted", TERMINATED: "terminated"}

# Typer has moved this class between its versions; its public subclass tells where it is.
UsageError = cast("type[typer.BadParameter]", typer.BadParameter.__mro__[1])
TASK_COMMANDS = (
    "run",
    "watch",
    "simulate",
    "validate",
    "analyze",
    "export",
)  # they know tasks from elsewhere


@app.callback(invoke_without_command=True)
def start(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Show the version and exit.")] = False,
) -> None:
    """Dim a display over time: within a power budget, and never faster than a limit measured with people.

    Start with: evenlight demo --out demo

    `evenlight COMMAND --help` explains a command, and ends with two examples. With --quiet, commands
    print readings and names alone, not what their files tell. With --large-ok, they read files of any size.
    With --figures svg or pdf, they write figures as such, too; --figure-style FILE.mplstyle is their look.
    """
    if version:
        import evenlight

        typer.echo(f"evenlight {evenlight.__version__}")
    elif context.invoked_subcommand is None:
        typer.echo(context.get_help())
    elif context.invoked_subcommand in TASK_COMMANDS:
        load_tasks()


def _display(name_or_path: str) -> Display:
    """Return a display, of a preset's name or a file."""
    from evenlight.method.preset_files import load_display

    return load_display(name_or_path)


def _request_problems(request: ResultRequest) -> Iterator[tuple[str, str]]:
    """Yield the keys of a request that cannot be, and what is wrong."""
    mounted = next(group[request.command] for group in COMMANDS.values() if request.command in group)
    command = typer.main.get_command(app).commands[request.command]  # type: ignore[attr-defined] # of a group
    return problems_in(request, command, kinds_in_file(signature(mounted, eval_str=True)))


def draws(command: Callable[..., Any]) -> Callable[..., Any]:
    """Return a command that writes figures as one that takes how they are written and drawn."""

    @functools.wraps(command)
    def drawn(figures: list[str] | None = None, figure_style: str | None = None, **given: Any) -> Any:
        from evenlight.analysis.figure_style import figures_as

        with figures_as(*figures or (), style=figure_style):
            return command(**given)

    declared = signature(command, eval_str=True)
    every = [
        *declared.parameters.values(),
        added("figures", list[str], expert(help="Write figures as such, too; may be given twice.")),
        added("figure_style", str, expert(help="Style sheet (.mplstyle) that figures follow.")),
    ]
    drawn.__signature__ = declared.replace(parameters=every)  # type: ignore[attr-defined] # Typer reads it
    return drawn


def guarded(command: Callable[..., Any]) -> Callable[..., Any]:
    """Return a command, declared in full, that refuses numbers with which nothing can be computed."""

    @functools.wraps(command)
    def checked(**given: Any) -> Any:
        for name, value in given.items():
            for number in value if isinstance(value, list | tuple) else (value,):
                require_computable(f"--{name.strip('_').replace('_', '-')}", number)
        return command(**given)

    checked.__signature__ = declared_by_name(command)  # type: ignore[attr-defined] # which Typer reads
    return checked


class _Command(HelpfulCommand):
    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except InputError as error:
            raise InputError(told_as_given(error, ctx)) from error


# The groups of `evenlight --help`, in the order of `help_pages.GROUPS`; what is used most comes first.
COMMANDS: dict[str, dict[str, Callable[..., Any] | typer.Typer]] = {
    "Start here": {
        "demo": draws(demo_command.demo),
        "displays": displays_command.displays,
        "new": new_command.new,
    },
    "Video": {
        "optimize": recorded("optimize", draws(optimize_command.optimize)),
        "catalogue": recorded("catalogue", draws(catalogue_command.catalogue)),
        "control": recorded("control", draws(control_command.control)),
        "judge": recorded("judge", draws(judge_command.judge)),
        "play": play_command.play,
        "walk": play_command.walk,
        "apply": apply_command.apply,
        "follow": follow_command.follow_command,
        "live": live_command.live_command,
        "track": track_command.track,
        "render": stimuli_commands.render,
    },
    "Calibration": {"fit": recorded("fit", draws(fit_commands.fit))},
    "Experiments": {
        "plan": draws(plan_command.plan),
        "run": draws(measuring_commands.run),
        "watch": watch_command.watch,
        "simulate": experiment_commands.simulate,
    },
    "Instruments": {"measure": measure_command.measure},
    "Statistics": {
        "analyze": recorded("analyze", draws(analyze_command.analyze)),
        "reproduce": draws(reproduce_command.reproduce),
    },
    "Files": {
        "validate": validate_command.validate_command(_request_problems),
        "import": import_command.import_command(_display),
        "export": export_command.export,
        "bench": bench_command.bench,
    },
}
measure_command.measure.command("saving")(draws(measuring_commands.saving))
measure_command.measure.command("played")(draws(measuring_commands.played))
for panel, commands in COMMANDS.items():
    for name, mounted in commands.items():
        if isinstance(mounted, typer.Typer):
            app.add_typer(mounted, name=name, cls=HelpfulGroup, rich_help_panel=panel)
        else:
            app.command(name, rich_help_panel=panel)(mounted)
for level in (app, *(group.typer_instance for group in app.registered_groups)):
    assert level is not None
    for one in level.registered_commands:
        assert one.callback is not None
        one.callback, one.cls = guarded(one.callback), _Command


def main(arguments: list[str] | None = None) -> None:
    """Run the command; end with exit code 2 and one line if its input cannot be used, 1 if a device fails.

    Parameters
    ----------
    arguments : list of str, optional
        In place of the command line's.
    """
    given = sys.argv[1:] if arguments is None else arguments
    gc.set_threshold(5000)  # new objects; at Python 3.11's 700 garbage takes a tenth of a short `optimize`
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a code page without "≤" or "λ", as on Windows
    progress.told_by_default, progress.begun = "--quiet" not in given, time.monotonic()
    if ANY_SIZE in given:
        os.environ[LARGE_OK] = "1"
    logging.getLogger("matplotlib").setLevel(logging.CRITICAL)  # its lines are none of ours
    warnings.filterwarnings("ignore", "Glyph .* missing", UserWarning)
    with printed_streams():
        _run(given)


def _run(given: Sequence[str]) -> NoReturn:
    """Do what the command line asks, and end with what it is to say at the end."""
    try:
        _refuse_empty(given)
        with _termination_raised():
            code = app(
                [word for word in given if word != ANY_SIZE], prog_name="evenlight", standalone_mode=False
            )
            if sys.stdout is not None:
                sys.stdout.flush()  # what cannot be written is told here, not at Python's end
    except InputError as error:
        _end(str(error), 2)
    except InstrumentError as error:
        _end(str(error), 1)
    except UsageError as error:
        _end(_usage(error, given), 2)
    except _Terminated:
        code = TERMINATED
    except (typer.Abort, KeyboardInterrupt):
        code = INTERRUPTED
    except RuntimeError as error:  # Python 3.11 wraps what comes while a class is made
        if not isinstance(error.__cause__, KeyboardInterrupt | _Terminated):
            raise
        code = TERMINATED if isinstance(error.__cause__, _Terminated) else INTERRUPTED
    except BrokenPipeError:  # nobody reads what it says any more
        sys.stdout = None
        code = 1
    except OSError as error:  # a full disk, a folder of someone else: no defect of Evenlight
        sys.stdout = None  # else Python tries again at its end, and ends with another code
        _end(_system_error(error), 2)
    except MemoryError:
        _end("this needs more memory than there is; give less at a time", 2)
    except Exception as error:
        if type(error).__module__ != "_moderngl":  # not imported for this: most commands draw nothing
            raise
        _end(f"the graphics driver failed ({' '.join(str(error).split())}): update it, or draw smaller", 1)
    if code in STOPPED:  # Typer may have turned an interruption into its number
        _end(f"{STOPPED[code]}; nothing half-written is left", code)
    sys.exit(code or 0)


def _refuse_empty(arguments: Sequence[str]) -> None:
    """Refuse an empty name, which as a path would stand for the current folder; and two requests."""
    if sum(word.partition("=")[0] == "--request" for word in arguments) > 1:
        raise InputError("--request is given twice; give one, and beside it what is to differ")
    for before, word in itertools.pairwise(["", *arguments]):
        option, equals, value = word.partition("=")
        if not word or (equals and not value and option.startswith("--")):
            where = option or (before if before.startswith("--") else "an argument")
            raise InputError(f"{where} is empty; give it a value, or leave it out")


class _Terminated(BaseException):
    """Someone asked the process to end; like an interruption, it is no error that a program handles."""


@contextmanager
def _termination_raised() -> Iterator[None]:
    """Turn the signals that end a process (SIGTERM; SIGHUP, of a terminal that was closed) into an exception.

    So what was begun is cleared.
    """

    def once(number: int, _: object) -> None:
        signal.signal(number, signal.SIG_IGN)  # clearing away is not to be interrupted
        raise _Terminated

    if threading.current_thread() is not threading.main_thread():  # Python lets no other set handlers
        yield
        return
    ends = [signal.SIGTERM, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else [])]
    before = {end: signal.signal(end, once) for end in ends}
    try:
        yield
    finally:
        for end, handler in before.items():
            signal.signal(end, handler or signal.SIG_DFL)


def _usage(error: typer.BadParameter, given: Sequence[str]) -> str:
    """Return what is wrong with the command line, and where its help is."""
    where = error.ctx.command_path if error.ctx else "evenlight"
    said = error.format_message().replace("Value error, ", "").rstrip(".")
    wrong = getattr(error, "option_name", "").strip("-").replace("-", "_")
    if right := RIGHT_NAMES.get(wrong):
        said = f"{said.partition(' (')[0]}: it is called --{right.replace('_', '-')}"
    elif wrong and (why := next((GONE[name] for name in (wrong, *_option_names(given)) if name in GONE), "")):
        said = f"{said.partition(' (')[0]}: {why}"
    elif possible := getattr(error, "possibilities", None):  # options that look like it
        said = f"{said.partition(' (')[0]}. Did you mean {' or '.join(possible)}?"
    elif "valid number" in said and (share := re.search(r"(\d+\.?\d*) ?%", " ".join(given))):
        said = f"{said.partition(': ')[0]}: {share[0]} is written {float(share[1]) / 100:g}"
    return f"{said}{' See' if said.endswith('?') else '; see'} {where} --help"


def _option_names(given: Sequence[str]) -> list[str]:
    """Return the names of the options on a command line."""
    return [word.partition("=")[0][2:].replace("-", "_") for word in given if word.startswith("--")]


def _system_error(error: OSError) -> str:
    """Return what the operating system refused, and of which file."""
    where = os.fsdecode(error.filename) if isinstance(error.filename, str | bytes) else "a file or stream"
    return f"{where} cannot be read or written: {error.strerror or error}"


def _end(message: str, code: int) -> NoReturn:
    """Say one line on the error stream, if anybody still reads it, and end."""
    try:
        print("evenlight: " + " ".join(message.split()), file=sys.stderr, flush=True)
    except OSError:
        sys.stderr = None  # else Python tries again at its end, and ends with another code
    sys.exit(code)
