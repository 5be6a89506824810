"""The command that shows the whole loop with simulated participants."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evenlight.data_schema.errors import ArgumentError
from evenlight.option_panels import ForceOption, QuietOption, expert

DATASET = "dataset"


def demo(
    out: Annotated[Path, typer.Option(help="Folder for all results; report.html in it explains them.")],
    participants: Annotated[int, typer.Option(help="How many people to simulate.", min=2, max=9999)] = 10,
    budget: Annotated[
        float, typer.Option(help="Mean brightness factor of the track, 0.2 to 1 (full brightness).")
    ] = 0.4,
    seed: Annotated[int, expert(help="Seed of the random numbers.")] = 1,
    force: ForceOption = False,
    quiet: QuietOption = False,
) -> None:
    """See the whole loop, small: simulated calibration, rate limit, a track, a report."""
    from evenlight.analysis.tracks.closed_loop import close_loop
    from evenlight.analysis.tracks.first_page import first_page
    from evenlight.data_schema.storage.result_folders import result_folder
    from evenlight.experiments.simulate_command import simulate
    from evenlight.stimuli.sequences import built_in_sequence

    if not 0.2 <= budget <= 1:
        raise ArgumentError("budget", f"must lie between 0.2 and 1, got {budget:g}")
    with result_folder(out, "demo", force=force) as folder:
        simulate("ramp", folder / DATASET, participants, seed, quiet=True)
        sunrise = built_in_sequence("sunrise", size=(384, 216), duration=40.0, frames_per_second=12.5)
        summary = close_loop(folder / DATASET, sunrise, budget, folder, quiet)
    if not quiet:
        typer.echo("\n".join(first_page(summary)))
        typer.echo(
            f"{out / 'report.html'} tells the whole loop, with simulated participants; "
            f"{out / 'track' / 'player.html'} plays the video with its track"
        )
