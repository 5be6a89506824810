"""Evenlight's one command: it mounts the commands of the folders, and turns input errors into one line."""

from __future__ import annotations

import sys

import typer

from analysis import fit_commands, optimize_command
from data_schema.errors import InputError
from experiments import commands as experiment_commands
from stimuli import commands as stimuli_commands

app = typer.Typer(
    name="evenlight",
    help="Temporal brightness management: dim a display over time, at a power budget, unseen.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


@app.callback()
def commands() -> None:
    """Temporal brightness management: dim a display over time, at a power budget, unseen."""


app.command()(stimuli_commands.render)
app.command()(experiment_commands.simulate)
app.command()(fit_commands.fit)
app.command()(optimize_command.optimize)


def main() -> None:
    """Run the command; end with exit code 2 and one line if its input cannot be used."""
    try:
        app()
    except InputError as error:
        print(f"evenlight: {error}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
