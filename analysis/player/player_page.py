"""The player page: one HTML file that shows a video beside its dimmed versions, and its track over time."""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray
from PIL import Image

from evenlight.analysis.player.picture_recorder import PictureRecorder
from evenlight.analysis.player.proxy_video import PAGE_BYTES, Proxy, Tiles, tiles_of
from evenlight.analysis.tracks.contrast_map_figure import ContrastMap, contrast_maps
from evenlight.analysis.tracks.first_page import key_figures, verdict
from evenlight.analysis.tracks.optimization_job import OptimizationJob
from evenlight.analysis.tracks.track_figure import DrawnTrack
from evenlight.analysis.tracks.track_words import budget_in_words, detail_sentences, uses_same_power
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import ContrastModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.storage.whole_files import write_whole
from evenlight.data_schema.tracks.loaded_track import frame_durations
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.power import power
from evenlight.progress import shown_progress
from evenlight.stimuli.sequence_format import SequenceFormat

PLAYER = "player.html"
COMMON_GAMMA = 2.2  # of ordinary monitors, nearly that of sRGB (IEC 61966-2-1)
WIDEST_MAPPED = 480  # [pixels] of the averages of a frame that its contrast is computed of
TILE_WIDTH = 160  # [pixels]
PICTURE, PART = "&picture;", 3 << 20  # where its base64 comes, as no name is written; bytes of it at a time
COLUMNS = 4
MOST_PIXELS, FEWEST = 17e6, 4  # of all frames that are shown, which takes half a second; so many at least


@dataclass(frozen=True, slots=True, eq=False)
class PlayerContent:
    """What a player page shows."""

    data: DrawnTrack
    display: Display  # that the track was made for
    constant_power: (
        Array | None
    )  # under constant dimming while each frame is shown [W], (N,); None: not known
    picture: Proxy | Tiles  # the video; of a very long one, still pictures
    # where contrast is lost, as PNG: red is the share of the visible contrast at a place that is lost with
    # the track, green with constant dimming
    contrast: Tiles
    notes: tuple[str, ...] = ()  # what is to be said of the picture below it, e.g. how large it is
    details: str = ""  # more of that, for those who ask


def player_content(
    job: OptimizationJob,
    data: DrawnTrack,
    curves: LossCurves,
    recorder: PictureRecorder,
) -> PlayerContent:
    """Return what the page of a track shows, from the curves, frames and picture of its video."""
    factors = np.full(curves.n_frames, data.summary.baseline_factor)
    model = job.request.power_model
    constant = None if model is None else power(model, factors, curves.channel_means)
    picture = recorder.picture(curves)
    with shown_progress(job.quiet, f"maps of lost contrast of {curves.video}"):
        contrast, detail = contrast_tiles(data, curves.display, job.model)
    shown, why = _of_the_picture(picture, curves)
    notes = [f"{shown} Maps of lost contrast for {len(contrast.frames)} frames."]
    if isinstance(getattr(recorder.source, "format", None), SequenceFormat):
        notes.append(f"{curves.video} is a built-in sequence: rendered, not filmed.")
    if job.request.rate_limit.simulated:
        notes.append("The rate limit is of simulated participants.")
    return PlayerContent(data, curves.display, constant, picture, contrast, tuple(notes), f"{why} {detail}")


def _of_the_picture(picture: Proxy | Tiles, curves: LossCurves) -> tuple[str, str]:
    """Say what the picture is, and why it is not the video."""
    if isinstance(picture, Tiles):
        every = float(curves.durations.sum()) * np.diff(picture.frames, append=0)[0] / curves.n_frames
        why = f"The video is too long for a moving picture in a page of {PAGE_BYTES / 1e6:.0f} MB."
        return f"Picture: {len(picture.frames)} stills, one every {every:.3g} s.", why
    shown = f"Picture: {picture.width} × {picture.height} copy, no sound."
    return shown, f"It is H.264 of at most {picture.rate / 1000:.0f} kbit/s, so that the page stays small."


def contrast_tiles(data: DrawnTrack, display: Display, model: ContrastModel) -> tuple[Tiles, str]:
    """Return where some frames lose visible contrast, by the map of the figure, and what to say of it.

    Red is the share of the visible contrast at a place that is lost with the track, green with constant
    dimming. The track's samples are averaged to at most 480 pixels across, so that it takes
    little time: detail finer than that is left out, and the map is of the finest that is left. Of large
    frames, some are passed over. The display is at the pixels per degree of the analysis.
    """
    held = data.samples
    high, wide = held[0][1].shape[:2]
    held = held[:: min(math.ceil(len(held) * high * wide / MOST_PIXELS), max(1, len(held) // FEWEST))]
    maps = [
        contrast_maps(pixels, data.compared_at(index), display, model, WIDEST_MAPPED)
        for index, pixels in held
    ]
    width = min(TILE_WIDTH, wide)
    height = max(1, round(high * width / wide))
    pictures = [_tile(ours, constant, (width, height)) for ours, constant in maps]
    details = " or ".join(sorted({f"{ours.frequency:.3g}" for ours, _ in maps}, key=float))
    finer = "; finer detail is averaged away" if maps[0][0].averaged else ""
    said = f"The maps are of details of {details} cycles per degree{finer}."
    return tiles_of(pictures, [index for index, _ in held], COLUMNS, "PNG"), said


def _tile(ours: ContrastMap, constant: ContrastMap, size: tuple[int, int]) -> NDArray[np.uint8]:
    """Return the shares that are lost, ours red and constant green, over rectangles of the map's pixels.

    A map of coarse detail may have fewer pixels than the tile, of some width and height: they are repeated.
    """
    masks = np.stack([ours.lost, constant.lost, ours.reference], axis=-1)
    small = np.asarray(Image.fromarray(masks.astype(np.uint8) * 255).resize(size, Image.Resampling.BOX))
    visible = np.maximum(small[..., 2:], 1.0)
    shares = np.where(small[..., 2:] > 0, np.minimum(small[..., :2] / visible, 1.0), 0.0)
    return np.dstack([np.rint(255 * shares), np.zeros(size[::-1])]).astype(np.uint8)


def write_player_page(path: Path, content: PlayerContent) -> None:
    """Write a page that needs no other file and no network, opened by a double click."""
    price = path.with_name("price.png")  # of one video; clips that share a budget have one for all
    write_whole(path, _parts(content, price.read_bytes() if price.is_file() else b""))


def player_html(content: PlayerContent, price: bytes = b"") -> str:
    """Return the page's HTML, which holds everything that it needs; the price of invisibility as PNG, too."""
    return b"".join(_parts(content, price)).decode()


def _parts(content: PlayerContent, price: bytes) -> Iterator[bytes]:
    """Yield the page's HTML; the picture, which is most of it, is never there as a whole."""
    before, _, after = _around_picture(content, price).partition(PICTURE)
    yield before.encode(errors="backslashreplace")
    for first in range(0, len(content.picture.data), PART):
        yield base64.b64encode(content.picture.data[first : first + PART])
    yield after.encode(errors="backslashreplace")


def _around_picture(content: PlayerContent, price: bytes) -> str:
    from jinja2 import Environment, PackageLoader, StrictUndefined  # not needed where no page is written

    room = Environment(
        loader=PackageLoader("evenlight.analysis", "player"), undefined=StrictUndefined, autoescape=True
    )
    data, display, summary = content.data, content.display, content.data.summary
    return room.get_template("page.html").render(
        file=_file,
        data=_script_data(content),
        title=f"{data.track.header.video} on {display.name}, {budget_in_words(summary)}",
        verdict=verdict(summary),
        told=f"{data.does_not_count}{detail_sentences(summary)}",
        figures=key_figures(summary),
        display=display,
        pixels=data.track.header.actuator is Actuator.PIXELS,
        notes=content.notes,
        details=content.details,
        price=_base64(price),
        constant=summary.baseline_factor,
        on_other_monitor=summary.baseline_factor ** (COMMON_GAMMA / display.gamma),
        common_gamma=COMMON_GAMMA,
        constant_name=f"constant, same {'power' if uses_same_power(summary) else 'mean factor'}",
        reflected_most=max(0.1 * display.peak_luminance, 2 * display.reflected_luminance),
    )


def _file(name: str) -> Markup:
    return Markup((Path(__file__).parent / name).read_text(encoding="utf-8"))


def _script_data(content: PlayerContent) -> Markup:
    """Return the content as JSON that no HTML in a name can break; arrays as base64 of float32."""
    data, display, picture = content.data, content.display, content.picture
    track = data.track
    rate = np.divide(track.rate, track.rate_limit, out=np.zeros_like(track.rate), where=track.rate_limit > 0)
    record = {
        "end": float(track.times[-1] + frame_durations(track)[-1]),
        "times": _base64(track.times.astype("<f8")),
        "factors": _floats(track.factors),
        "constantFactor": data.summary.baseline_factor,
        "loss": _floats(100 * track.contrast_loss),
        "constantLoss": _floats(100 * data.baseline_loss),
        "rate": _floats(100 * rate),
        "power": None if track.power is None else _floats(track.power),
        "constantPower": None if content.constant_power is None else _floats(content.constant_power),
        "gamma": display.gamma,
        "lightRange": display.peak_luminance - display.black_level,
        "picture": _pictures(picture, "video/mp4" if isinstance(picture, Proxy) else "image/jpeg", PICTURE),
        "contrast": _pictures(content.contrast, "image/png", _base64(content.contrast.data)),
    }
    return Markup(json.dumps(record, allow_nan=False).replace("<", "\\u003c"))


def _pictures(picture: Proxy | Tiles, kind: str, data: str) -> dict[str, Any]:
    """Return a video or a sheet of pictures, of a MIME type, for the script; its data as base64."""
    found = {
        "url": f"data:{kind};base64,{data}",
        "width": picture.width,
        "height": picture.height,
        "frames": _base64(picture.frames.astype("<f8")),
    }
    if isinstance(picture, Proxy):
        return {**found, "times": _base64(picture.times.astype("<f8"))}
    return {**found, "columns": picture.columns}


def _floats(values: Array) -> str:
    return _base64(values.astype("<f4"))  # seven digits are more than the page shows


def _base64(content: bytes | NDArray[Any]) -> str:
    return base64.b64encode(bytes(content) if isinstance(content, bytes) else content.tobytes()).decode()
