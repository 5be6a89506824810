"""Options of dimming that several commands share, each declared once: what is dimmed, on what, to what aim.

A field is an option: its name, type, default and help are those of the command line. Nothing here is slow to
import.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from evenlight.data_schema.errors import ArgumentError
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.film_reading import Damaged
from evenlight.method.choices import LimitCurve
from evenlight.option_panels import asked, computation, expert, limits, viewing

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import TypeAlias, TypeVar

    from evenlight.data_schema.contrast_model import ContrastModel
    from evenlight.data_schema.display import Display
    from evenlight.data_schema.power_model import PowerModel
    from evenlight.data_schema.rate_limit import RateLimit
    from evenlight.stimuli.video.frames_in_memory import Frames
    from evenlight.stimuli.video.video_source import VideoSource

    Kind = TypeVar("Kind")
    Member: TypeAlias = Kind | str  # of an enumeration, or its value
    File = str | PathLike[str]
    NamedDisplay = Display | File  # or the name of a preset, or a file
    NamedPowerModel = PowerModel | File
    NamedRateLimit = RateLimit | File
    NamedContrastModel = ContrastModel | File
    Names = str | Sequence[str]  # with commas between them
    Videos = Sequence[str | PathLike[str] | VideoSource | Frames]
else:  # what the command line takes of these

    class Member:
        """The enumeration itself, of which Typer takes the values."""

        def __class_getitem__(cls, kind: Any) -> Any:
            return kind

    NamedDisplay = NamedPowerModel = NamedRateLimit = NamedContrastModel = str
    File, Names, Videos = Path, str, list[str]

BATTERIES = (0.001, 1e6)  # [Wh]
MIN_FACTORS = (0.001, 0.99)  # a display can hardly be dimmed further; beyond, there is nothing left to choose
GAINS = ("proportional", "integral", "derivative", "gain_rate")

VideoArgument = Annotated[
    str,
    typer.Argument(
        help="The video: a file, a URL such as s3://bucket/film.mp4, a folder of images, or a built-in "
        "sequence: library, gym, living_room, basement, house, checkerboard, sunrise."
    ),
]
TrackArgument = Annotated[
    Path,
    typer.Argument(
        help="Its track: the folder that `evenlight optimize` wrote, or track.csv with track.json beside it."
    ),
]
DisplayOption = Annotated[
    NamedDisplay | None,
    viewing(
        help="The display: a preset such as laptop-lcd, or a file such as desk.display.toml.",
        show_default="that of rig, limit or track",
    ),
]
FpsOption = Annotated[
    float | None, viewing(help="Frames per second, for a folder of images or a built-in sequence.")
]
DamagedOption = Annotated[
    Member[Damaged],
    expert(help="Refuse a damaged film, or hold or skip what is lost up to its next key frame."),
]
StreamOption = Annotated[
    int | None, expert(metavar="N", help="Stream of the film, as FFmpeg counts; else that of players.")
]
JobsOption = Annotated[
    int, computation(help="How many frames to analyse at the same time, each on a core; 0: on all cores.")
]
NoCacheOption = Annotated[
    bool, expert("--no-cache", help="Neither use nor keep loss curves and pictures in the user's cache.")
]
power_model_option = viewing(
    help="How much power the display takes at each brightness: a preset, or a toml file that `evenlight fit` "
    "wrote for a power sweep.",
    show_default="the display's, if it has one",
)
device_option = expert(
    help="What computes loss curves: the processor, the graphics processor (OpenGL 4.3), or that where it is "
    "hardware."
)


@dataclass(frozen=True, kw_only=True)
class OnDisplay:
    """The display, and whether what was made for another will do."""

    display: DisplayOption = None
    other_display_ok: Annotated[
        bool,
        expert(
            "--other-display-ok",
            help="Use a rate limit or a track of another display, at your own risk.",
        ),
    ] = False

    @property
    def display_name(self) -> str | None:
        """The display as the command line has it: a preset or a file."""
        return None if self.display is None else str(self.display)


@dataclass(frozen=True, kw_only=True)
class WithinLimit:
    """How fast luminance may change."""

    rate_limit: Annotated[
        NamedRateLimit,
        limits(help="How fast luminance may change: a preset, or rate_limit.json of `evenlight fit`."),
    ] = "surace2025"
    noticed: Annotated[
        float | None,
        limits(
            metavar="SHARE",
            help="How often the median person may notice a change at the limit, guesses aside: 0.5, say.",
            show_default="as fitted: 75 % of all trials",
        ),
    ] = None
    limit_curve: Annotated[
        Member[LimitCurve], expert(help="The fitted rate limit, or the lower (safe) edge of its 95 % band.")
    ] = LimitCurve.FITTED
    accept_wide_band: Annotated[
        bool,
        expert(
            "--accept-wide-band",
            help="Use a rate limit even if it is known too imprecisely (its band is missing or too wide).",
        ),
    ] = False


@dataclass(frozen=True, kw_only=True)
class AimOptions:
    """What the online controller aims at, and its gains."""

    target_loss: Annotated[
        float | None,
        asked(
            help="Share of visible contrast that each frame may lose, 0 to 1; with --budget only to begin "
            "with."
        ),
    ] = field(default=None, kw_only=False)
    budget: Annotated[
        float | None, asked(help="Budget to meet on average, in --budget-unit; the target loss follows it.")
    ] = None
    budget_unit: Annotated[
        Member[BudgetUnit] | None,
        asked(
            help="What --budget counts: the mean brightness factor, the share of the power at full "
            "brightness, or watts.",
            show_default="factor",
        ),
    ] = None
    horizon: Annotated[
        float | None, asked(help="Time over which the mean is to meet the budget.", show_default="60")
    ] = None
    proportional: Annotated[
        float | None, expert(metavar="K_P", help="Proportional gain.", show_default="0.2")
    ] = None
    integral: Annotated[
        float | None,
        expert(metavar="K_I", help="Integral gain, per frame of --gain-rate.", show_default="0.01"),
    ] = None
    derivative: Annotated[
        float | None,
        expert(metavar="K_D", help="Derivative gain, per frame of --gain-rate.", show_default="0.05"),
    ] = None
    gain_rate: Annotated[
        float | None,
        expert(
            metavar="HZ",
            help="Frame rate that the gains are for; 0: that of the video or the display.",
            show_default="90",
        ),
    ] = None

    @property
    def gains(self) -> dict[str, Any]:
        """The gains that are given, by name; a rate of 0 is None."""
        given = {name: gain for name in GAINS if (gain := getattr(self, name)) is not None}
        return given | ({"gain_rate": None} if self.gain_rate == 0 else {})


def names_in(given: Names) -> list[str]:
    """Return the names of measures, given as a list or in a text with commas between them."""
    items = given.split(",") if isinstance(given, str) else given
    if odd := [item for item in items if not isinstance(item, str)]:
        raise ArgumentError("measures", f"must be names, got {odd[0]!r}")
    return [name for item in items if (name := item.strip())]
