"""The commands of the experiments."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import require_seed
from evenlight.data_schema.recordings.session import BUILT_IN_TASKS
from evenlight.option_panels import QuietOption, asked, expert, output, words_and_files
from evenlight.progress import shown_progress

MAX_PARTICIPANTS = 9999


def simulate(
    task: Annotated[
        str,
        typer.Argument(
            help="Which experiment: ramp, rating, comparison, search, or a task of your own.",
            autocompletion=words_and_files(*BUILT_IN_TASKS),
        ),
    ],
    out: Annotated[Path, output(help="Folder of the data set, which is made.")],
    participants: Annotated[int, asked(help="How many people to simulate.")] = 20,
    seed: Annotated[int, expert(help="Seed of the random numbers.")] = 1,
    display: Annotated[
        str | None,
        asked(
            help="Display that is looked at: a preset such as laptop-lcd, or a file such as "
            "desk.display.toml.",
            show_default="that of the stimuli, or varjo-xr3",
        ),
    ] = None,
    design: Annotated[
        str | None,
        asked(
            help="What is shown, and how often: a preset (paper, recommended, quick, ...) or a toml file.",
            show_default="paper",
        ),
    ] = None,
    stimuli: Annotated[
        Path | None, asked(help="rating, comparison, search: folder with a track for each sequence.")
    ] = None,
    quiet: QuietOption = False,
) -> None:
    """Let many simulated participants answer an experiment, without a window: a data set to try things on."""
    from evenlight.data_schema.recordings.session import TASKS

    if task not in TASKS:
        raise InputError(f"task {task!r} cannot be simulated; there is {', '.join(map(repr, TASKS))}")
    if not 1 <= participants <= MAX_PARTICIPANTS:
        raise InputError(f"--participants must lie in 1 to {MAX_PARTICIPANTS}, got {participants}")
    require_seed(seed)
    viewing = [name for name, of in TASKS.items() if "sequences" in of.design.__dataclass_fields__]
    if (task in viewing) != (stimuli is not None):
        raise InputError(
            f"--stimuli goes with {', '.join(viewing[:-1])} and {viewing[-1]}, which need it; got "
            f"the task {task} {'with' if stimuli else 'without'} it"
        )
    from evenlight.experiments.viewing.simulate_viewing import load_simulation, simulate_viewing

    simulation = load_simulation(task, stimuli, (participants, seed), display, design)
    with shown_progress(quiet, "simulating participants", participants) as progress:
        simulate_viewing(simulation, out, progress.at)
    if not quiet:
        typer.echo(f"{participants} simulated participants in {out}")
