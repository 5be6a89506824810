"""The player page: one HTML file that shows a video beside its dimmed versions, and its track over time."""

from __future__ import annotations

import base64
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from evenlight.analysis.figure_style import short
from evenlight.analysis.tracks.track_figure_data import TrackFigureData, budget_in_words, outcome_in_words
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.quantities import read_only
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.storage.whole_files import write_whole
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack
from evenlight.data_schema.tracks.loaded_track import frame_durations

COMMON_GAMMA = 2.2  # of ordinary monitors, nearly that of sRGB (IEC 61966-2-1)
Frames = NDArray[np.int64]  # which frames of the video, in order


@dataclass(frozen=True, slots=True, eq=False)
class Proxy:
    """A video, encoded small enough for a page.

    Attributes
    ----------
    data : bytes
        The file: H.264 in MP4.
    width, height : int
        Of its picture [pixels].
    times, frames : arrays, (M,)
        When each encoded frame appears, as the file has it [s], and which frame of the video it is.
    rate : float
        Bits a second that it was allowed at most.
    """

    data: bytes
    width: int
    height: int
    times: Array
    frames: Frames
    rate: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "times", read_only(self.times))
        object.__setattr__(self, "frames", read_only(self.frames, np.int64))
        if len(self.times) != len(self.frames) or len(self.times) == 0:
            raise ValueError(
                f"need a time for each encoded frame, got {len(self.times)} for {len(self.frames)}"
            )


@dataclass(frozen=True, slots=True, eq=False)
class Tiles:
    """Small pictures of some frames, side by side on one sheet, row by row.

    Attributes
    ----------
    data : bytes
        The sheet: a JPEG of stills, a PNG of contrast maps.
    width, height, columns : int
        Of each picture [pixels], and how many there are in a row of the sheet.
    frames : array, (M,)
        Which frame of the video each is.
    """

    data: bytes
    width: int
    height: int
    columns: int
    frames: Frames

    def __post_init__(self) -> None:
        object.__setattr__(self, "frames", read_only(self.frames, np.int64))


@dataclass(frozen=True, slots=True, eq=False)
class PlayerContent:
    """What a player page shows.

    Attributes
    ----------
    data : TrackFigureData
        The track and constant dimming, as in the figure of the track.
    display : Display
        The display that the track was made for.
    constant_power, full_power : array, (N,), float
        Power under constant dimming while each frame is shown, and mean power at full brightness [W].
    picture : Proxy or Tiles
        The video; of a very long one, still pictures.
    contrast : Tiles, optional
        Where contrast is lost, as PNG: red is the share of the visible contrast at a place that is lost
        with the track, green with constant dimming.
    notes : tuple of str
        What is to be said of the picture below it, e.g. how large it is.
    details : str
        More of that, for those who ask.
    """

    data: TrackFigureData
    display: Display
    constant_power: Array
    full_power: float
    picture: Proxy | Tiles
    contrast: Tiles | None = None
    notes: tuple[str, ...] = ()
    details: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "constant_power", read_only(self.constant_power))
        if len(self.constant_power) != len(self.data.track.times):
            raise ValueError(
                f"constant_power must have one value for each of the {len(self.data.track.times)} frames, "
                f"got {len(self.constant_power)}"
            )


def write_player_page(path: Path, content: PlayerContent) -> None:
    """Write a page that needs no other file and no network, opened by a double click.

    Parameters
    ----------
    path : Path
        Of the page, e.g. `player.html`; written whole.
    content : PlayerContent
        What it shows.
    """
    write_whole(path, player_html(content))


def player_html(content: PlayerContent) -> str:
    """Return the page's HTML, which holds everything that it needs."""
    from jinja2 import Environment, PackageLoader, StrictUndefined  # not needed where no page is written

    room = Environment(
        loader=PackageLoader("evenlight.analysis", "player"), undefined=StrictUndefined, autoescape=True
    )
    data, display = content.data, content.display
    return room.get_template("page.html").render(
        file=_file,
        data=_script_data(content),
        title=f"{data.track.header.video} on {display.name}, {budget_in_words(data)}",
        gained=data.gained,
        outcome=outcome_in_words(data),
        figures=_key_figures(content),
        display=display,
        pixels=data.track.header.actuator is Actuator.PIXELS,
        notes=content.notes,
        details=content.details,
        constant=data.baseline_factor,
        on_other_monitor=data.baseline_factor ** (COMMON_GAMMA / display.gamma),
        common_gamma=COMMON_GAMMA,
        constant_name="constant, same power" if data.same_power else "constant, same mean factor",
        reflected_most=max(0.1 * display.peak_luminance, 2 * display.reflected_luminance),
    )


def _file(name: str) -> Markup:
    """Return a script or style of this folder as it is, which is for the page to hold."""
    return Markup((Path(__file__).parent / name).read_text(encoding="utf-8"))


def _key_figures(content: PlayerContent) -> list[tuple[str, str, str]]:
    """Return what is gained at a glance: name, figure, and what it is to be compared with."""
    data, track = content.data, content.data.track
    durations = frame_durations(track)
    power, constant = (float(np.average(p, weights=durations)) for p in (track.power, content.constant_power))
    loss, constant_loss = (
        float(np.average(x, weights=durations)) for x in (track.contrast_loss, data.baseline_loss)
    )
    other = "" if data.same_power else f"constant {short(constant)}, "
    fastest = 100 * float(np.max(np.abs(rate_shares(track))))
    return [
        ("Power", f"{short(power)} W", f"{other}full brightness {short(content.full_power)} W"),
        ("Unevenness of contrast loss", short(data.objective), f"constant {short(data.objective_baseline)}"),
        ("Mean contrast loss", f"{short(100 * loss)} %", f"constant {short(100 * constant_loss)} %"),
        ("Fastest change", f"{short(fastest)} %", "of the rate limit ΔL"),
    ]  # fmt: skip


def rate_shares(track: BrightnessTrack) -> Array:
    """Return the rate of each step as a share of its limit, signed, (N,); 0 where nothing may change.

    >>> from types import SimpleNamespace
    >>> track = SimpleNamespace(rate=np.array([-1.0, 0.0]), rate_limit=np.array([2.0, 0.0]))
    >>> rate_shares(track).tolist()
    [-0.5, 0.0]
    """
    return np.divide(track.rate, track.rate_limit, out=np.zeros_like(track.rate), where=track.rate_limit > 0)


def _script_data(content: PlayerContent) -> Markup:
    """Return the content as JSON that no HTML in a name can break; arrays as base64 of float32."""
    data, display, picture = content.data, content.display, content.picture
    track = data.track
    record = {
        "end": float(track.times[-1] + frame_durations(track)[-1]),
        "times": _base64(track.times.astype("<f8")),
        "factors": _floats(track.factors),
        "constantFactor": data.baseline_factor,
        "loss": _floats(100 * track.contrast_loss),
        "constantLoss": _floats(100 * data.baseline_loss),
        "rate": _floats(100 * rate_shares(track)),
        "power": _floats(track.power),
        "constantPower": _floats(content.constant_power),
        "gamma": display.gamma,
        "lightRange": display.peak_luminance - display.black_level,
        "picture": _pictures(picture, "video/mp4" if isinstance(picture, Proxy) else "image/jpeg"),
        "contrast": _pictures(content.contrast, "image/png") if content.contrast else None,
    }
    return Markup(json.dumps(record, allow_nan=False).replace("<", "\\u003c"))


def _pictures(picture: Proxy | Tiles, kind: str) -> dict[str, Any]:
    """Return a video or a sheet of pictures, of a MIME type, for the script."""
    found = {
        "url": f"data:{kind};base64,{_base64(picture.data)}",
        "width": picture.width,
        "height": picture.height,
        "frames": _base64(picture.frames.astype("<f8")),
    }
    if isinstance(picture, Proxy):
        return {**found, "times": _base64(picture.times.astype("<f8"))}
    return {**found, "columns": picture.columns}


def _floats(values: Array) -> str:
    """Return numbers as the page keeps them: seven digits are more than it shows."""
    return _base64(values.astype("<f4"))


def _base64(content: bytes | NDArray[Any]) -> str:
    """Return bytes as text."""
    return base64.b64encode(bytes(content) if isinstance(content, bytes) else content.tobytes()).decode()
