"""Options that the commands which make a brightness track have in common, and their checks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.method.choices import Device, LimitCurve, ModulatedLuminance

if TYPE_CHECKING:
    from evenlight.data_schema.contrast_model import ContrastModel
    from evenlight.data_schema.display import Display

MIN_FACTORS = (0.001, 0.99)  # a display can hardly be dimmed further; beyond, there is nothing left to choose
VideoArgument = Annotated[
    str, typer.Argument(help="Video file, folder of images, or name of a built-in sequence.")
]
BudgetUnitOption = Annotated[
    BudgetUnit, typer.Option(help="Mean brightness factor, share of full power, or watt.")
]
DisplayOption = Annotated[str, typer.Option(help="Display: a preset or a toml file.")]
PowerModelOption = Annotated[str, typer.Option(help="Power model: a preset or a toml file.")]
RateLimitOption = Annotated[str, typer.Option(help="Rate limit: a preset or a json file of `evenlight fit`.")]
ContrastModelOption = Annotated[
    str,
    typer.Option(
        help="Choices of the contrast model: a toml file, or default, as-printed, soft, castle, absolute, "
        "suprathreshold."
    ),
]
LimitCurveOption = Annotated[
    LimitCurve, typer.Option(help="The fitted rate limit, or the lower edge of its band.")
]
ModulatedOption = Annotated[ModulatedLuminance, typer.Option(help="Luminance the rate limit is about.")]
MinFactorOption = Annotated[float, typer.Option(help="Lowest brightness factor allowed, 0.001 to 0.99.")]
FieldOfViewOption = Annotated[
    float | None,
    typer.Option(
        help="Degrees that the video's width spans; else as it was rendered for, or pixel for pixel."
    ),
]
ActuatorOption = Annotated[
    Actuator, typer.Option(help="What dims: the backlight, or pixels, which show nothing below black.")
]
FpsOption = Annotated[
    float | None, typer.Option(help="Frames per second of a folder of images or a sequence.")
]
CurvesOption = Annotated[
    Path | None, typer.Option(help="Loss curves (npz) of an earlier run on this video and display.")
]
JobsOption = Annotated[
    int, typer.Option(help="Frames to analyse at a time, each on a core; 0 for all cores.")
]
DeviceOption = Annotated[
    Device, typer.Option(help="What computes loss curves; auto: compute shaders where hardware runs them.")
]
OtherDisplayOption = Annotated[
    bool, typer.Option("--other-display-ok", help="Accept a rate limit fitted on another display.")
]
AcceptWideBandOption = Annotated[
    bool, typer.Option("--accept-wide-band", help="Use a rate limit that is known too badly all the same.")
]
NoCacheOption = Annotated[
    bool, typer.Option("--no-cache", help="Use and keep no loss curves or pictures in the user's cache.")
]
NoPlayerOption = Annotated[
    bool, typer.Option("--no-player", help="Leave out player.html, the page that shows video and track.")
]
QuietOption = Annotated[bool, typer.Option("--quiet", help="No progress bar, no closing lines.")]


def check_video(video: str, min_factor: float, field_of_view: float | None, jobs: int) -> None:
    """Refuse, in one line, what no video can be analysed with.

    Parameters
    ----------
    video, min_factor, field_of_view, jobs : str, float, float or None, int
        The options of these names.

    Raises
    ------
    InputError
        If one of them is out of its range.
    """
    if not video:
        raise InputError(
            "the video has an empty name; give a file, a folder of images or a built-in sequence"
        )
    require_between("--min-factor", min_factor, MIN_FACTORS)
    if field_of_view is not None:
        from evenlight.stimuli.sequence_format import NARROWEST, WIDEST

        require_between("--field-of-view", field_of_view, (NARROWEST, WIDEST))
    if jobs < 0:
        raise InputError(f"--jobs must be 0 (all cores) or more, got {jobs}")


def require_curves_to_compute(curves: Path | None, jobs: int, device: Device) -> None:
    """Refuse options of how loss curves are computed where they are given."""
    if curves is not None and (jobs != 1 or device is not Device.CPU):
        raise InputError("--jobs and --device are for computing loss curves, which --curves gives")


def require_there(option: str, path: Path | None, expected: str) -> None:
    """Refuse a file or folder that is not there, before anything is analysed.

    Parameters
    ----------
    option : str
        Its name.
    path : Path or None
        What it was given; None for nothing.
    expected : str
        What would be right.
    """
    if path is not None and not path.exists():
        raise InputError(f"{option} {path}: no such file; give {expected}")


def require_between(name: str, value: float, limits: tuple[float, float]) -> None:
    """Refuse a value of an option outside of its limits, by the option's name."""
    low, high = limits
    if not low <= value <= high:
        raise InputError(f"{name} must lie in {low:g} to {high:g}, got {value:.15g}")


def chosen_device(device: Device, display: Display, model: ContrastModel, quiet: bool) -> Device:
    """Return the device that computes loss curves, and say why it is not the graphics processor.

    Parameters
    ----------
    device : Device
        What is asked for.
    display, model : Display, ContrastModel
        What the curves are for: the graphics processor cannot do all choices of the model.
    quiet : bool
        Whether to say nothing.

    Raises
    ------
    InputError
        If the graphics processor is asked for, and there is none that can.
    """
    from evenlight.method.contrast.loss_curves import SMALLEST_SIDE, brightness_factors, make_frame_analysis

    if device is Device.CPU:
        return device
    smallest = (SMALLEST_SIDE, SMALLEST_SIDE)
    chosen = make_frame_analysis(smallest, display, model, brightness_factors(), device)
    if not quiet:
        by = "by OpenGL" if chosen.device is Device.GPU else "on the processor"
        typer.echo(f"loss curves {by}: {chosen.reason}", err=True)
    return chosen.device


def results_in(out: Path) -> str:
    """Return where the results are, and what to open first."""
    page = out / "player.html"
    return f"results in {out}" + (f"; {page} shows them in a browser" if page.is_file() else "")
