"""The brightness track: one factor per frame, with what it does to contrast, luminance and power.

As it is kept, as it is exported for other programs, and sections of a video that weigh on it otherwise.
"""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from typing import Any

from evenlight.data_schema.display import COARSEST, FINEST, HIGHEST_LUMINANCE, Display
from evenlight.data_schema.errors import InputError, told_of_file
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.power_model import PanelKind, PowerModel
from evenlight.data_schema.provenance import Provenance, sha256_of_bytes, sha256_of_file
from evenlight.data_schema.quantities import (
    Array,
    array_shapes,
    as_in,
    count,
    described,
    file_key,
    one_line,
    quantity,
    read_only,
    record,
    rises,
    share,
)
from evenlight.data_schema.recordings.ramp import Procedure
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.storage.tables import csv_rows, csv_text, number_in, numbered_rows
from evenlight.data_schema.storage.text_files import read_json_record, write_json
from evenlight.data_schema.storage.whole_files import write_whole
from evenlight.data_schema.tracks.film_reading import FilmReading

ROUNDING = 1e-3  # s: sections whose ends are rounded to milliseconds overlap by as much
LUMINANCE_SLACK = 1e-3  # share of a display's luminance, for means of 32-bit numbers
DERIVED = 2 * LUMINANCE_SLACK  # share by which a column may miss what it follows from
MOST_GAPS = 2.0  # a frame is shown for as long as until the next one begins, or half of it
ACTUATOR = "what dims the video: the backlight, or pixels, which show nothing darker than the display's black"
PROCEDURE = "what the participants of the rate limit were asked"
WIDE_BAND = "true if the rate limit's band is too wide for use or missing, and was accepted all the same"


class BudgetUnit(enum.Enum):
    """What a budget counts."""

    FACTOR = "factor"  # mean brightness factor, as in the paper
    POWER = "power"  # share of the power at full brightness
    WATT = "watt"  # mean power


@record
class WatchedTrack:
    """How well people who watch a plain screen for a track's changes notice them."""

    periods: int = count("periods of a ramp's duration that the track is cut into", minimum=1)
    noticed: float = share(
        "share of them in which the median participant notices a change, beyond guesses and lapses"
    )
    noticed_sensitive: float = share(
        "the same for a sensitive participant, whose threshold is at the 5th percentile"
    )
    assumed: str = described("what of people was assumed for that; empty where the calibration tells")


@record
class TrackHeader:
    """What a brightness track was made for, and how; the sidecar `track.json`."""

    video: str = described("name of the video")
    display_name: str = described("display that it was made for")
    display_fingerprint: str = described("identity of that display's photometry")
    power_model: str | None = described("name of the power model; null: none is known of the display")
    rate_limit: str = described("name of the rate limit")
    budget: float = quantity("1", "the budget, in its unit", above=0.0)
    budget_unit: BudgetUnit = described("what the budget counts")
    solver: str = described("which solver made it")
    provenance: Provenance = described("how the file was made")
    rate_limit_procedure: Procedure | None = described(PROCEDURE, default=None)
    pixels_per_degree: float | None = quantity(
        "1/deg",
        "pixels of the analysed video per degree of visual angle, in its middle: how large it is to be seen; "
        "null if not known",
        minimum=COARSEST,
        maximum=FINEST,
        default=None,
    )
    wide_band_accepted: bool = described(WIDE_BAND, default=False)
    field_of_view: float | None = quantity(
        "deg",
        "horizontal angle that the video was analysed for; null if it was taken pixel for pixel",
        above=0.0,
        maximum=180.0,
        key="field_of_view_deg",
        default=None,
    )
    actuator: Actuator = described(ACTUATOR, default=Actuator.BACKLIGHT)
    loss_added_by_pixels: float | None = share(
        "contrast loss that is added where pixels dim instead of the backlight that the track was made for: "
        "the largest in 16 or fewer sampled frames, so at least this in the video; null if not known",
        default=None,
    )
    display: Display | None = described(
        "the display that it was made for; null in tracks of earlier versions", default=None
    )
    panel: PowerModel | None = described(
        "the power model that it was made with; null in tracks of earlier versions", default=None
    )
    noticed: float | None = share(
        "share of detections, beyond guesses and lapses, that the rate limit was moved to; null: as fitted",
        above=0.0,
        default=None,
    )
    watched: WatchedTrack | None = described(
        "how well its changes are noticed by who watches for them; null if not known", default=None
    )
    film: FilmReading | None = described(
        "how the video's file was read; null where only loss curves were, and in older tracks", default=None
    )
    files: dict[str, str] = described(
        "SHA-256 of the table, and of files beside it that belong to it; empty in tracks of earlier versions",
        factory=dict,
    )


@record
class BrightnessTrack:
    """A brightness factor for each of N frames; the columns of `track.csv`."""

    times: Array = quantity("s", "when the frame appears", key="time_s", shape=("N",))
    factors: Array = share("brightness factor b", above=0.0, key="factor", shape=("N",))
    contrast_loss: Array = share("contrast loss 𝓛_c of the dimmed frame", shape=("N",))
    mean_luminance: Array = quantity(
        "cd/m^2",
        "mean luminance of the dimmed frame, reflected light included",
        minimum=0.0,
        maximum=2 * HIGHEST_LUMINANCE,
        shape=("N",),
    )
    rate: Array = quantity(
        "cd/m^2/s",
        "luminance change per second that the modulation makes from this frame to the next; "
        "signed, 0 in the last frame",
        shape=("N",),
    )
    rate_limit: Array = quantity(
        "cd/m^2/s", "what that change may be at most, in either direction (ΔL)", minimum=0.0, shape=("N",)
    )
    power: Array | None = quantity(
        "W",
        "power of the display while the frame is shown; empty without a power model",
        minimum=0.0,
        shape=("N",),
    )
    header: TrackHeader = described("what the track was made for, and how")

    def __post_init__(self) -> None:
        columns = (column for name in _ARRAYS if (column := getattr(self, name)) is not None)
        if len({len(column) for column in columns}) != 1 or len(self.times) == 0:
            raise ValueError("the columns of a track must be equally long and hold at least one frame")
        if not rises(self.times):
            raise ValueError("time_s must rise from frame to frame")

    def __repr__(self) -> str:
        return one_line(self, self.header.video, self.times, factor=self.factors)


_ARRAYS = tuple(array_shapes(BrightnessTrack))
TRACK_COLUMNS = ("frame", *(file_key(f) for f in dataclasses.fields(BrightnessTrack) if f.name in _ARRAYS))


def track_columns(track: BrightnessTrack) -> dict[str, Any]:
    """Return the columns of `track.csv` by name: the number of each frame, and arrays (N,), or None."""
    arrays = [getattr(track, name) for name in _ARRAYS]
    return dict(zip(TRACK_COLUMNS, [range(len(track.times)), *arrays], strict=True))


def write_track(path: Path, track: BrightnessTrack, beside: Sequence[str] = ()) -> None:
    """Write a track as a csv table, and its header as a json file of the same name beside it.

    Parameters
    ----------
    path, track : Path, BrightnessTrack
        The table, and the track.
    beside : sequence of str
        Files of the same folder that belong to it, and are there: the header has their SHA-256, too.
    """
    empty = [None] * len(track.times)
    arrays = list(track_columns(track).values())[1:]
    columns = [empty if column is None else column.tolist() for column in arrays]
    rows = ([i, *cells] for i, cells in enumerate(zip(*columns, strict=True)))
    table = csv_text(TRACK_COLUMNS, rows)
    write_whole(path, table)
    files = {path.name: sha256_of_bytes(table.encode())}
    files |= {name: sha256_of_file(path.with_name(name)) for name in beside}
    header = dataclasses.replace(track.header, files=files)
    write_json(path.with_suffix(".json"), mapping_from_record(header))


def read_track(path: Path) -> BrightnessTrack:
    """Return the track of a csv table and its json header.

    Raises
    ------
    InputError
        If either is unusable, or they were not written together.
    """
    for file in (path, path.with_suffix(".json")):
        with suppress(PermissionError):  # reading the file says so
            if not file.exists():
                raise InputError(f"{file}: no such file; there is no brightness track without it")
    header = read_json_record(TrackHeader, path.with_suffix(".json"))
    rows = csv_rows(path, TRACK_COLUMNS, "a brightness track (csv)")
    names = TRACK_COLUMNS  # the last is power, which is empty where it is not known
    table, lines = [], []
    for frame, (line, cells) in enumerate(rows):
        where = f"{path}, line {line}"
        if cells[0] != str(frame):
            raise InputError(f"{where}: frame: expected {frame}, the frames from 0 on, got {cells[0]!r}")
        if frame == 0 and not cells[-1]:
            names = TRACK_COLUMNS[:-1]
        if bool(cells[-1]) != (names is TRACK_COLUMNS):
            raise InputError(f"{where}: {TRACK_COLUMNS[-1]}: expected a number in every row, or in none")
        lines.append(line)
        table.append([number_in(cell, f"{where}: {name}") for name, cell in zip(names, cells, strict=False)])
    if not table:
        raise InputError(f"{path}: expected a row for each frame, got none; the table is empty or torn")
    columns = read_only(table).T[1:]  # the number of the frame is its place
    try:
        given = dict(zip(_ARRAYS, columns, strict=False))
        track = BrightnessTrack(**{"power": None, **given}, header=header)
    except ValueError as error:
        raise InputError(f"{path}: {told_of_file(error)}") from error
    for name, low, high in possible_columns(track):
        got = getattr(track, name)
        wrong = (got < low - DERIVED * abs(low)) | (got > high + DERIVED * abs(high))
        if wrong.any():
            k = int(wrong.argmax())
            column = TRACK_COLUMNS[1 + _ARRAYS.index(name)]
            reach = f"{low[k]:.6g}" if low[k] == high[k] else f"{low[k]:.6g} to {high[k]:.6g}"
            raise InputError(
                f"{path}, line {lines[k]}: {column} of frame {k} contradicts the factors: at "
                f"{track.factors[k]:g} expected {reach}, got {got[k]:.6g}; make the track again"
            )
    require_written_with(header, path)
    return track


def require_written_with(header: TrackHeader, path: Path) -> None:
    """Raise `InputError` if a file is not the one that a track's header was written with."""
    known = header.files.get(path.name)
    if known is not None and known != sha256_of_file(path):
        raise InputError(
            f"{path}: is not the file that track.json beside it was written with: of another result, or "
            "changed since; make the track again, or take `files` out of track.json if the change is your own"
        )


def possible_columns(track: BrightnessTrack) -> Iterator[tuple[str, Array, Array]]:
    """Yield the columns that follow from others: the name, and between what arrays (N,) its numbers lie.

    Luminance lies between that of black and of white at a factor, if the display is known. Power is that of
    the panel, if it is known; of an OLED, between black and white. A rate is a step of the factor, of no more
    than white, in the time of a frame, and within its limit.
    """
    import numpy as np

    factors, display, panel = track.factors, track.header.display, track.header.panel
    steps = np.append(np.diff(factors), 0.0)
    fastest = np.where(steps == 0, 0.0, track.rate_limit)
    if display is not None:
        seconds = np.append(np.diff(track.times), 1.0)
        fastest = np.minimum(fastest, MOST_GAPS * abs(steps) * display.peak_luminance / seconds)
        ends = (display.black_level, display.peak_luminance)
        low, high = (factors * light + display.reflected_luminance for light in ends)
        yield "mean_luminance", low, high
    yield "rate", np.where(steps < 0, -fastest, 0.0), np.where(steps > 0, fastest, 0.0)
    if panel is not None and track.power is not None:
        most = panel.base_power + factors * panel.light_power[0]
        yield "power", most if panel.kind is PanelKind.LCD else np.full_like(most, panel.base_power), most


def require_display_of(header: TrackHeader, display: Display, named: str, otherwise: str = "") -> None:
    """Raise `InputError` if a track was made for another display than the one it is used on.

    Parameters
    ----------
    header : TrackHeader
        The track's.
    display : Display
        The one that it is used on.
    named : str
        What `--display` takes for that one, for the message.
    otherwise : str
        Another way out.
    """
    if header.display_fingerprint != display.fingerprint:
        same = " in another calibration" if header.display_name == display.name else ""
        raise InputError(
            f"the track was made for the display {header.display_name!r}, and here is {display.name!r}{same}"
            f": make a track for this one with `evenlight optimize VIDEO --display {named} ...`{otherwise}"
        )


def require_light_of(track: BrightnessTrack, display: Display, path: Path) -> None:
    """Raise `InputError` if a frame of a track is brighter than white is at its factor.

    Parameters
    ----------
    track, path : BrightnessTrack, Path
        The track, and its file for the message.
    display : Display
        The one that it was made for.
    """
    white = track.factors * display.peak_luminance + display.reflected_luminance
    wrong = track.mean_luminance > white * (1 + LUMINANCE_SLACK)
    if wrong.any():
        k = int(wrong.argmax())
        raise InputError(
            f"{path}: frame {k}: mean_luminance_cd_m2 of {track.mean_luminance[k]:g} contradicts the factor "
            f"{track.factors[k]:g}, at which white on {display.name!r} has {white[k]:.4g} cd/m^2; make the "
            "track again"
        )


STEP = (
    "step: a factor holds from the time of its frame until that of the next; "
    "before the first frame the first holds, after the last the last"
)


@record
class ExportedTrack:
    """The brightness factors of a video over time, for any program: `evenlight track export --to json`."""

    video: str = as_in(TrackHeader, "video")
    video_sha256: str | None = described("SHA-256 of the video's file; null if it is not known")
    version: str = described("dimmed by its track, or constantly at equal power", pattern="ours|constant")
    display_name: str = as_in(TrackHeader, "display_name")
    peak_luminance: float = as_in(Display, "peak_luminance")
    gamma: float = as_in(Display, "gamma")
    baseline: float = share("the constant factor at which the display takes equal power", above=0.0)
    interpolation: str = described("which factor holds between the times", pattern="step: .*")
    times: tuple[float, ...] = quantity(
        "s", "when each frame appears, from the first frame on", min_items=1, key="times_s"
    )
    factors: tuple[float, ...] = share(
        "brightness factor of each frame: of linear light; gamma-encoded values take factor^(1/gamma)",
        above=0.0,
        min_items=1,
    )
    provenance: Provenance = described("how the file was made")
    film: FilmReading | None = as_in(TrackHeader, "film")

    def __post_init__(self) -> None:
        if len(self.times) != len(self.factors):
            raise ValueError(
                f"times_s and factors must be equally long, got {len(self.times)} and {len(self.factors)}"
            )
        if any(later <= earlier for earlier, later in zip(self.times, self.times[1:], strict=False)):
            raise ValueError("times_s must rise from frame to frame")


LARGEST_WEIGHT = (
    1e6  # weights or multiples of the rate limit: beyond, a section means "no other" or "no limit"
)


@record
class VideoSection:
    """What is asked of a section of a video; a row of `*.weights.csv` or `*.allowances.csv`, or of both."""

    start: float = quantity(
        "s",
        "where the section begins; a frame that appears then, and the step to it, belong to it",
        minimum=0.0,
        key="start_s",
    )
    end: float = quantity("s", "where it ends; a frame that appears then is outside", above=0.0, key="end_s")
    weight: float | None = quantity(
        "1",
        "how much each of its frames counts in the objective; empty: 1, as of frames outside all sections",
        minimum=0.0,
        maximum=LARGEST_WEIGHT,
        default=None,
    )
    allowance: float | None = quantity(
        "1",
        "multiple of the fitted rate limit: 0 holds brightness still; empty: 1, as outside all sections",
        minimum=0.0,
        maximum=LARGEST_WEIGHT,
        default=None,
    )

    def __post_init__(self) -> None:
        if not self.start < self.end:
            raise ValueError(f"need start_s < end_s, got {self.start:g} and {self.end:g}")


def read_sections(path: Path, column: str) -> tuple[VideoSection, ...]:
    """Return the sections of a table that says a `weight` or an `allowance` of them.

    Raises
    ------
    InputError
        If it is no such table, or sections overlap by more than times are rounded.
    """
    rows = numbered_rows(VideoSection, path)
    if rows and all(getattr(section, column) is None for _, section in rows):
        raise InputError(f"{path}: says no {column}; give a csv table start_s,end_s,{column}")
    for (line, earlier), (next_line, later) in pairwise(sorted(rows, key=lambda row: row[1].start)):
        if later.start < earlier.end - ROUNDING:
            raise InputError(
                f"{path}, line {next_line}: the section from {later.start:g} to {later.end:g} s overlaps "
                f"that of line {line}, from {earlier.start:g} to {earlier.end:g} s; give each frame one "
                "section"
            )
    return tuple(section for _, section in rows)
