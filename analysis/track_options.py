"""Options that the commands which make a brightness track have in common, and their checks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.method.choices import Device, LimitCurve, ModulatedLuminance
from evenlight.method.contrast.measures import MEASURES
from evenlight.option_panels import asked, computation, limits, output, viewing, words_and_files

if TYPE_CHECKING:
    from evenlight.data_schema.contrast_model import ContrastModel
    from evenlight.data_schema.display import Display
    from evenlight.data_schema.rate_limit import RateLimit

MIN_FACTORS = (0.001, 0.99)  # a display can hardly be dimmed further; beyond, there is nothing left to choose
VideoArgument = Annotated[
    str,
    typer.Argument(
        help="The video: a file, a URL such as s3://bucket/film.mp4, a folder of images, or a built-in "
        "sequence: library, gym, living_room, basement, house, checkerboard, sunrise."
    ),
]
BudgetUnitOption = Annotated[
    BudgetUnit,
    asked(
        help="What --budget counts: the mean brightness factor, the share of the power at full brightness, "
        "or watts."
    ),
]
DisplayOption = Annotated[
    str | None,
    viewing(
        help="The display that the track is for: a preset such as laptop-lcd, or a file such as "
        "desk.display.toml.",
        show_default="that of the rate limit, or of the track",
    ),
]
PowerModelOption = Annotated[
    str,
    viewing(
        help="How much power the display takes at each brightness: a preset, or a toml file that "
        "`evenlight fit` wrote for a power sweep."
    ),
]
RateLimitOption = Annotated[
    str, limits(help="How fast luminance may change: a preset, or rate_limit.json of `evenlight fit`.")
]
ContrastModelOption = Annotated[
    str,
    viewing(
        metavar="NAME|FILE",
        help="How loss of visible contrast is computed: default, as-printed (the paper to the letter), soft, "
        "castle, absolute, suprathreshold, or a toml file.",
        autocompletion=words_and_files("as-printed", *MEASURES),
    ),
]
LimitCurveOption = Annotated[
    LimitCurve, limits(help="The fitted rate limit, or the lower (safe) edge of its 95 % band.")
]
ModulatedOption = Annotated[
    ModulatedLuminance,
    limits(
        help="Which luminance the limit holds for: the mean of the frame, or that of a white screen "
        "(stricter)."
    ),
]
MinFactorOption = Annotated[
    float, asked(help="Lowest brightness factor allowed, 0.001 to 0.99: 0.2 is a fifth of full brightness.")
]
FieldOfViewOption = Annotated[
    float | None,
    viewing(
        help="Visual angle that the width of the video spans. Otherwise as it was rendered for, or one pixel "
        "of the video on each pixel of the display."
    ),
]
ActuatorOption = Annotated[
    Actuator,
    viewing(
        help="What dims the display: its backlight, or its pixels (as on OLED), which show nothing below "
        "the black level."
    ),
]
FpsOption = Annotated[
    float | None, viewing(help="Frames per second, for a folder of images or a built-in sequence.")
]
CurvesOption = Annotated[
    Path | None,
    computation(help="loss_curves.npz of an earlier run on this video and display, to save the analysis."),
]
JobsOption = Annotated[
    int, computation(help="How many frames to analyse at the same time, each on a core; 0: on all cores.")
]
DeviceOption = Annotated[
    Device,
    computation(
        help="What computes loss curves: the processor, the graphics processor (OpenGL 4.3), or that where "
        "it is hardware."
    ),
]
OtherDisplayOption = Annotated[
    bool,
    limits(
        "--other-display-ok", help="Use a rate limit that was measured on another display, at your own risk."
    ),
]
AcceptWideBandOption = Annotated[
    bool,
    limits(
        "--accept-wide-band",
        help="Use a rate limit even if it is known too imprecisely (its band is missing or too wide).",
    ),
]
BatteryOption = Annotated[
    float | None,
    output(
        metavar="WH",
        min=0.001,
        max=1e6,
        help="Capacity of a battery, in watt hours, to say how long the display lasts on it.",
    ),
]
NoCacheOption = Annotated[
    bool, computation("--no-cache", help="Neither use nor keep loss curves and pictures in the user's cache.")
]
NoPlayerOption = Annotated[
    bool,
    output("--no-player", help="Do not write player.html, the page that plays the video with its track."),
]
QuietOption = Annotated[bool, typer.Option("--quiet", help="Print no progress and no closing lines.")]


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


def borrowed_line(limit: RateLimit, display: Display) -> str:
    """Return a line that says that a rate limit was fitted on another display; nothing if it was not."""
    if limit.holds_for(display):
        return ""
    return f"rate limit borrowed: fitted on {limit.display_name!r}, unproven on {display.name!r}\n"


def results_in(out: Path) -> str:
    """Return where the results are, and what to open first."""
    page = out / "player.html"
    return f"results in {out}" + (f"; {page} shows them in a browser" if page.is_file() else "")
