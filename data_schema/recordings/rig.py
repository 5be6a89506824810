"""The rig: display, distance, refresh rate, keys and what makes the brightness, as one file of a lab."""

from __future__ import annotations

import enum

from evenlight.data_schema.display import COARSEST, FINEST
from evenlight.data_schema.display import Actuator as Actuator
from evenlight.data_schema.quantities import described, quantity, record

# What is printed on a key, in lower case, or its name as PsychoPy has it; a name that no key has would never
# be answered with.
KEY = (
    "^([^\\s,.=-]|f[1-9]|f1[0-2]|num_([0-9]|enter|add|subtract)|space|escape|return|tab|backspace|delete|insert|"
    "home|end|pageup|pagedown|left|right|up|down|lshift|rshift|lctrl|rctrl|lalt|ralt|comma|period|minus|equal)$"
)
METER = "^(none|simulated|manual|[a-z][a-z0-9_-]*:.*)$"  # an instrument: its driver and address
# Forms of addresses are known of these two; what others are is their drivers' affair.
BACKLIGHT = "^(none|simulated|sysfs:[^/]+|ddc:[0-9]+|(?!none:|sysfs:|ddc:)[a-z][a-z0-9_-]*:.+)$"
# What takes triggers: its driver and address; in words, and as a pattern.
TRIGGER_FORMS = (
    "simulated, serial:PORT, serial:PORT?baud=57600, rts:PORT, dtr:PORT, rts:PORT?pulse_ms=10 (1 or more), "
    "or lsl:NAME"
)
TRIGGER = (
    r"^(simulated|serial:[^?]+(\?baud=[1-9][0-9]*)?|lsl:.+|"
    r"(rts|dtr):[^?]+(\?pulse_ms=[1-9][0-9]*(\.[0-9]+)?)?)$"
)
# A headset: by the OpenXR runtime of the computer, or one that is made up.
HEADSET = "^(simulated:)?openxr$"
LARGEST_WINDOW = 32768  # [pixels] the largest picture that graphics processors draw
SLOWEST_DISPLAY = 20.0  # [Hz] below it no ramp looks continuous, and no display is made


class Dither(enum.Enum):
    """How a luminance between two codes of the display is drawn."""

    NOISY_BIT = "noisy_bit"  # fresh noise for each pixel and frame (Allard & Faubert 2008)
    ORDERED = "ordered"  # 8 x 8 threshold matrix (Bayer 1973)
    NONE = "none"  # rounding: a slow ramp becomes a few visible jumps


class Eye(enum.Enum):
    """An eye of a headset."""

    LEFT = "left"
    RIGHT = "right"


class Corner(enum.Enum):
    """A corner of the window."""

    TOP_LEFT = "top_left"
    TOP_RIGHT = "top_right"
    BOTTOM_LEFT = "bottom_left"
    BOTTOM_RIGHT = "bottom_right"


@record
class PhotodiodePatch:
    """A square in a corner of the window: white while a stimulus is shown, black otherwise."""

    corner: Corner = described("which corner", default=Corner.TOP_LEFT)
    size: int = quantity("pixels", "its width and height", minimum=8, maximum=512, default=64)


@record
class TriggerCodes:
    """The codes of a rig's triggers, 0 for one that is not sent; each event is labelled by its name here."""

    ramp_onset: int = quantity("1", "first frame of a ramp", minimum=0, maximum=255, default=1)
    ramp_offset: int = quantity("1", "first frame after it", minimum=0, maximum=255, default=2)
    video_onset: int = quantity("1", "first frame of a video", minimum=0, maximum=255, default=3)
    video_offset: int = quantity("1", "first frame after it", minimum=0, maximum=255, default=4)
    search_onset: int = quantity("1", "first frame of a search", minimum=0, maximum=255, default=5)
    search_offset: int = quantity("1", "first frame after it", minimum=0, maximum=255, default=6)
    question_onset: int = quantity("1", "first frame of a question", minimum=0, maximum=255, default=7)
    answer: int = quantity("1", "a key answered the question", minimum=0, maximum=255, default=8)


@record
class Keys:
    """The keys of a rig: by what is printed on them in lower case (y, ä), others by PsychoPy's names."""

    yes: str = described("answers that the brightness changed", default="y", pattern=KEY)
    no: str = described("answers that it did not", default="n", pattern=KEY)
    first: str = described("answers that it changed in the first interval", default="left", pattern=KEY)
    second: str = described("answers that it changed in the second interval", default="right", pattern=KEY)
    proceed: str = described("to the next page", default="space", pattern=KEY)
    pause: str = described("pauses at any time, and stops from there", default="escape", pattern=KEY)
    ratings: tuple[str, ...] = described(
        "ratings from 1 (low) to 5 (high)", default=("1", "2", "3", "4", "5"), pattern=KEY
    )
    found: str = described("a ring was found", default="space", pattern=KEY)
    orientations: tuple[str, ...] = described(
        "where the ring's gap is: right, upper right, up, ... counter-clockwise, as the numeric pad has them",
        default=("num_6", "num_9", "num_8", "num_7", "num_4", "num_1", "num_2", "num_3"),
        pattern=KEY,
    )
    turn_left: str = described("looks to the left", default="left", pattern=KEY)
    turn_right: str = described("looks to the right", default="right", pattern=KEY)
    turn_up: str = described("looks up", default="up", pattern=KEY)
    turn_down: str = described("looks down", default="down", pattern=KEY)

    def __post_init__(self) -> None:
        if len(self.ratings) != 5 or len(self.orientations) != 8:
            raise ValueError(
                f"need 5 keys for ratings and 8 for orientations, got {len(self.ratings)} and "
                f"{len(self.orientations)}"
            )
        turns = ("turn_left", "turn_right", "turn_up", "turn_down")
        # The keys that are asked for at the same time; the key that goes on may also say "found".
        together = {
            "yes, no, proceed": (self.yes, self.no, self.proceed),
            "first, second, proceed": (self.first, self.second, self.proceed),
            "ratings": self.ratings,
            "orientations": self.orientations,
            ", ".join((*turns, "found")): (*(getattr(self, turn) for turn in turns), self.found),
        }
        for group, keys in together.items():
            names = (*keys, self.pause)
            if len(set(names)) < len(names):
                raise ValueError(f"the keys {group} and pause must differ, got {', '.join(names)}")
            for name in names:
                if name != name.lower():
                    raise ValueError(f"keys are named in lower case: {name.lower()!r}, got {name!r}")


@record
class Rig:
    """What a session runs on."""

    name: str = described("name of the rig")
    display: str = described("its calibrated display: a preset, or a toml file (relative to the rig's own)")
    viewing_distance: float = quantity("m", "distance from eye to display", minimum=0.01, maximum=100.0)
    refresh_rate: float = quantity(
        "Hz", "refresh rate of the display", minimum=SLOWEST_DISPLAY, maximum=1000.0
    )
    screen: int | str = quantity(
        "1",
        "which screen of the computer, from 0; openxr for a headset, simulated:openxr for a made-up one",
        minimum=0,
        pattern=HEADSET,
        default=0,
    )
    full_screen: bool = described(
        "true if the window fills the screen, or each eye has the size that the headset recommends",
        default=True,
    )
    window_size: tuple[int, int] = quantity(
        "pixels",
        "width and height of a window that does not fill the screen; in a headset, of each eye",
        minimum=64,
        maximum=LARGEST_WINDOW,
        default=(1280, 720),
    )
    bits: int = quantity(
        "1", "bits of each colour channel: 8, or 10 if display and driver have them", default=8
    )
    dither: Dither = described("how luminances between two codes are drawn", default=Dither.NOISY_BIT)
    actuator: Actuator = described("what makes the brightness", default=Actuator.PIXELS)
    backlight: str = described(
        "none, simulated, sysfs:NAME for /sys/class/backlight/NAME, ddc:NUMBER for a monitor "
        "over DDC/CI, board:PORT, or DRIVER:ADDRESS as for the luminance meter",
        default="none",
        pattern=BACKLIGHT,
    )
    backlight_curve: str = described(
        "its measured luminance over the factor it is set to, a table of a luminance sweep "
        "(relative to the rig's file); empty if it is linear in light",
        default="",
    )
    luminance_meter: str = described(
        "none, simulated, manual, or DRIVER:ADDRESS as `evenlight measure list` has them, "
        "e.g. ls100:/dev/ttyUSB0; simulated:DRIVER is a package's driver on its emulated instrument",
        default="none",
        pattern=METER,
    )
    power_meter: str = described(
        "none, simulated, or DRIVER:ADDRESS as for the luminance meter", default="none", pattern=METER
    )
    calibration_age_limit: float | None = quantity(
        "d",
        "age beyond which a measured display or power model is refused; null for no limit",
        above=0.0,
        default=None,
        key="calibration_age_limit_days",
    )
    pixels_per_degree: float | None = quantity(
        "1/deg",
        "pixels per degree of a display that has no file yet; else its file has them",
        minimum=COARSEST,
        maximum=FINEST,
        default=None,
    )
    language: str = described("language of the pages shown, e.g. en", default="en", pattern="^[A-Za-z0-9-]+$")
    keys: Keys = described("what is pressed", factory=Keys)
    triggers: tuple[str, ...] = described(
        "devices that take a trigger when something is shown: simulated, or DRIVER:ADDRESS as "
        "`evenlight measure list` has them, e.g. serial:/dev/ttyUSB0?baud=115200",
        default=(),
        pattern=TRIGGER,
        form=TRIGGER_FORMS,
    )
    trigger_codes: TriggerCodes = described("what each trigger sends", factory=TriggerCodes)
    photodiode_patch: PhotodiodePatch | None = described(
        "corner that a photodiode looks at; null for none", default=None
    )
    eye: Eye = described(
        "of a headset: the eye whose luminance and pixels per degree count", default=Eye.LEFT, later=True
    )

    def __post_init__(self) -> None:
        if self.bits not in (8, 10):
            raise ValueError(f"bits must be 8 or 10, got {self.bits}")
        if not self.display:
            raise ValueError(
                "display must name a calibrated display, a preset or a toml file; without its luminances "
                "no ramp can be drawn"
            )
        if self.actuator is Actuator.BACKLIGHT and self.backlight == "none":
            raise ValueError("the actuator is the backlight, so backlight must name one, got 'none'")
        if self.actuator is Actuator.BACKLIGHT and self.backlight.startswith(("ddc:", "simulated:ddc")):
            raise ValueError(
                "a backlight over DDC/CI takes about 7 settings a second, too few for brightness that goes "
                "smoothly: let pixels be the actuator; sweeps measure the backlight all the same"
            )
        if self.backlight_curve and self.backlight == "none":
            raise ValueError("backlight_curve is of a backlight, so backlight must name one, got 'none'")
        if self.in_headset:
            self._check_headset()

    @property
    def in_headset(self) -> bool:
        """Whether it is shown in a headset."""
        return isinstance(self.screen, str)

    def _check_headset(self) -> None:
        if self.backlight != "none":
            raise ValueError(f"a headset's backlight is its own, and is not set: got {self.backlight!r}")
        if self.photodiode_patch is not None:
            raise ValueError("a headset has no corner for a photodiode: leave out photodiode_patch")
        if self.bits != 8:
            raise ValueError(f"a headset's runtime takes 8 bits of each colour, got bits = {self.bits}")
