"""Where sampled frames lose visible contrast, as one small sheet for the player page."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from evenlight.analysis.player.player_page import Tiles
from evenlight.analysis.player.proxy_video import sheet_of
from evenlight.analysis.tracks.contrast_map_figure import ContrastMap, contrast_maps
from evenlight.analysis.tracks.track_figure_data import TrackFigureData, compared_at
from evenlight.data_schema.contrast_model import ContrastModel
from evenlight.data_schema.display import Display

WIDEST = 480  # [pixels] of the averages of a frame that its contrast is computed of
TILE_WIDTH = 160  # [pixels]
COLUMNS = 4
MOST_PIXELS, FEWEST = 17e6, 4  # of all frames that are shown, which takes half a second; so many at least


def contrast_tiles(
    held: Sequence[tuple[int, NDArray[Any]]], data: TrackFigureData, display: Display, model: ContrastModel
) -> tuple[Tiles, str]:
    """Return where some frames lose visible contrast, by the map of the figure, and what to say of it.

    Red is the share of the visible contrast at a place that is lost with the track, green with constant
    dimming.

    Frames are averaged to at most 480 pixels across, so that it takes little time: detail finer than that
    is left out, and the map is of the finest that is left. Of large frames, some are passed over.

    Parameters
    ----------
    held, data : sequence of (int, array (height, width, 3)), TrackFigureData
        Some frames, as `FrameSamples.held`, and the track.
    display, model : Display, ContrastModel
        At the pixels per degree of the analysis; choices of the contrast model.
    """
    high, wide = held[0][1].shape[:2]
    held = held[:: min(math.ceil(len(held) * high * wide / MOST_PIXELS), max(1, len(held) // FEWEST))]
    maps = [contrast_maps(pixels, compared_at(data, index), display, model, WIDEST) for index, pixels in held]
    width = min(TILE_WIDTH, wide)
    height = max(1, round(high * width / wide))
    pictures = [_tile(ours, constant, (width, height)) for ours, constant in maps]
    columns = min(COLUMNS, len(pictures))
    frames = np.array([index for index, _ in held])
    file = io.BytesIO()
    Image.fromarray(sheet_of(pictures, columns)).save(file, "PNG")
    details = " or ".join(sorted({f"{ours.frequency:.3g}" for ours, _ in maps}, key=float))
    finer = "; finer detail is averaged away" if maps[0][0].averaged else ""
    said = f"The maps are of details of {details} cycles per degree{finer}."
    return Tiles(file.getvalue(), width, height, columns, frames), said


def _tile(ours: ContrastMap, constant: ContrastMap, size: tuple[int, int]) -> NDArray[np.uint8]:
    """Return the shares that are lost, ours red and constant green, over rectangles of the map's pixels.

    A map of coarse detail may have fewer pixels than the tile, of some width and height: they are repeated.
    """
    masks = np.stack([ours.lost, constant.lost, ours.reference], axis=-1)
    small = np.asarray(Image.fromarray(masks.astype(np.uint8) * 255).resize(size, Image.Resampling.BOX))
    visible = np.maximum(small[..., 2:], 1.0)
    shares = np.where(small[..., 2:] > 0, np.minimum(small[..., :2] / visible, 1.0), 0.0)
    return np.dstack([np.rint(255 * shares), np.zeros(size[::-1])]).astype(np.uint8)
