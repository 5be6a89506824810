"""The figure of visible and lost contrast in one frame, after the paper's figure of thresholded contrast."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from evenlight.analysis.figure_style import (
    BASELINE,
    LOST,
    MUTED,
    OURS,
    PAGE,
    FigureFormat,
    axes_at,
    heading_lines,
    lines_at,
    look,
    new_figure,
    text_size,
)
from evenlight.analysis.tracks.frame_samples import small_picture, square_means
from evenlight.data_schema.arrays import Mask
from evenlight.data_schema.contrast_model import DEFAULT_MODEL, ContrastModel, LossForm
from evenlight.data_schema.display import Display
from evenlight.method.contrast.contrast_loss import counted_map, loss_of
from evenlight.method.contrast.luminance import dimmed_luminance, emitted_luminance
from evenlight.method.contrast.pyramid import counted_frequencies
from evenlight.stimuli.video.frame_conversion import linear_light

SHOWN_SHARE = 0.01  # of the pixels must be visible for a band to be worth showing
WIDEST_MAP = 1280  # [pixels]; a panel of the figure has fewer


@dataclass(frozen=True, slots=True)
class ContrastMap:
    """Where a frame's contrast is visible in one band, at full brightness and dimmed.

    Attributes
    ----------
    factor, frequency : float
        Brightness factor b, and spatial frequency of the band [cpd].
    reference, dimmed : array of bool, (height, width)
        Where contrast is visible at full brightness, and dimmed by b.
    loss : float
        𝓛_c of the frame, over all bands.
    averaged : bool
        Whether finer detail than the frequency was left out.
    label : str
        What a figure calls it; empty for the usual name of its panel.
    """

    factor: float
    frequency: float
    reference: Mask
    dimmed: Mask
    loss: float
    averaged: bool = False
    label: str = ""

    @property
    def lost(self) -> Mask:
        """Where contrast is visible at full brightness only."""
        return self.reference & ~self.dimmed

    @property
    def lost_share(self) -> float:
        """Share of the band's visible contrast that is lost; 0 where nothing is visible."""
        visible = int(self.reference.sum())
        return float(self.lost.sum()) / visible if visible else 0.0


def contrast_map(
    pixel_values: NDArray[Any],
    factor: float,
    display: Display,
    model: ContrastModel = DEFAULT_MODEL,
    loss: float | None = None,
) -> ContrastMap:
    """Return where dimming by b loses visible contrast; as `contrast_maps`, at one factor.

    Parameters
    ----------
    pixel_values, factor : array, (height, width, 3), float
        The frame, as in `Frame`, and the brightness factor b.
    display, model : Display, ContrastModel
        The display, with its pixels per degree as in the analysis of the video; choices of the model.
    loss : float, optional
        𝓛_c of the frame where it is known, which says more of a wide frame than that of its averages.
    """
    return contrast_maps(pixel_values, [(factor, loss)], display, model)[0]


def contrast_maps(
    pixel_values: NDArray[Any],
    at: Sequence[tuple[float, float | None]],
    display: Display,
    model: ContrastModel = DEFAULT_MODEL,
    widest: int = WIDEST_MAP,
) -> tuple[ContrastMap, ...]:
    """Return where dimming loses visible contrast, in the finest band that has any worth showing.

    Of a frame wider than can be shown, squares of pixels are averaged in linear light: its map is of the
    finest band of those left.

    Parameters
    ----------
    pixel_values, at : array, (height, width, 3), sequence of (float, float or None)
        The frame, as in `Frame`; brightness factors b, each with 𝓛_c of the frame where it is known.
    display, model : Display, ContrastModel
        As in `contrast_map`.
    widest : int
        Most pixels that can be shown side by side.
    """
    across = -(-pixel_values.shape[1] // widest)
    if across > 1:
        light = square_means(pixel_values, across, lambda part: linear_light(part, display.gamma))
        pixel_values = light ** (1 / display.gamma)
        display = replace(display, pixels_per_degree=display.pixels_per_degree / across)
    emitted = emitted_luminance(pixel_values, display, model.pixel_to_luminance)
    # What is detected rather than not; of contrast above its threshold, whatever there is.
    counts = 0.0 if model.loss is LossForm.SUPRATHRESHOLD else 0.5
    reference, *each = (
        counted_map(dimmed_luminance(emitted, b, display), display, model)
        for b in (1.0, *(factor for factor, _ in at))
    )
    shares = [float((band > counts).mean()) for band in reference]
    band = next((k for k, share in enumerate(shares) if share >= SHOWN_SHARE), int(np.argmax(shares)))
    frequency = float(counted_frequencies((emitted.shape[0], emitted.shape[1]), display, model)[band])
    full = _mean_count(reference)
    maps = []
    for (factor, known), dimmed in zip(at, each, strict=True):
        loss = known if across > 1 else None
        loss = loss_of(_mean_count(dimmed), full, model.loss) if loss is None else loss
        seen = reference[band] > counts, dimmed[band] > counts
        maps.append(ContrastMap(factor, frequency, *seen, loss, across > 1))
    return tuple(maps)


def _mean_count(bands: Sequence[NDArray[Any]]) -> float:
    """Return how much counts in a pixel, on average over pixels and bands."""
    return float(np.mean([band.mean() for band in bands]))


def contrast_map_figure(
    pixel_values: NDArray[Any],
    ours: ContrastMap,
    baseline: ContrastMap,
    name: str = "",
    medium: FigureFormat = PAGE,
) -> Figure:
    """Draw a frame, and which of its contrast is visible and which is lost under two brightness factors.

    Parameters
    ----------
    pixel_values, name : array, (height, width, 3), str
        The frame, as in `Frame`, and what it is called, e.g. "bikes.mp4 at 4.2 s".
    ours, baseline : ContrastMap
        At the track's factor, and at that of constant dimming.
    medium : FigureFormat
        Where it is shown.
    """
    with look(medium):
        em, gap = medium.em, 1.2 * medium.em
        rows, columns = ours.reference.shape
        cell = (medium.width - 2 * em - 2 * gap) / 3
        high = min(cell * rows / columns, 0.7 * medium.height)
        wide = high * columns / rows
        lines, above = heading_lines(*_heading(ours, name), medium.width - 2 * em, em)
        key_columns = 3 if medium.width > 60 * em else 1
        panel_top = above + 5.2 * em
        figure = new_figure(medium, panel_top + high + (1.6 + 1.6 * 3 / key_columns) * em)
        lines_at(figure, em, lines)
        panels = [axes_at(figure, em + k * (cell + gap), panel_top, wide, high) for k in range(3)]
        panels[0].imshow(small_picture(pixel_values, 640), aspect="auto")
        _draw_map(panels[1], ours)
        _draw_map(panels[2], baseline)
        _name_panel(panels[0], "full brightness", ("the frame", ""), MUTED)
        _name_panel(panels[1], f"{ours.label or 'ours'}, b = {ours.factor:.2f}", _loss_in_words(ours), OURS)
        _name_panel(
            panels[2],
            f"{baseline.label or 'constant'}, b = {baseline.factor:.2f}",
            _loss_in_words(baseline),
            BASELINE,
        )
        _draw_key(figure, em, panel_top + high + 0.8 * em, key_columns)
    return figure


def _heading(ours: ContrastMap, name: str) -> tuple[str, str]:
    """Return title and subtitle."""
    where = f" of {name}" if name else ""
    if not ours.reference.any():
        return f"Visible contrast{where}", "Nothing in this frame is visible, even at full brightness."
    finest = "the finest that is drawn" if ours.averaged else "the finest with visible contrast"
    return f"Visible contrast{where}", f"Details at {ours.frequency:.3g} cpd (cycles per degree), {finest}."


def _loss_in_words(at: ContrastMap) -> tuple[str, str]:
    """Return how much is lost, in the band and over all bands."""
    return f"lost here: {100 * at.lost_share:.1f} %", f"over all bands: {100 * at.loss:.1f} %"


def map_picture(at: ContrastMap) -> NDArray[np.float64]:
    """Return the map in colours, (h, w, 3): visible contrast white, lost contrast red, the rest black."""
    picture = np.zeros((*at.reference.shape, 3))
    picture[at.reference & at.dimmed] = 1.0
    picture[at.lost] = to_rgb(LOST)
    return picture


def _draw_map(axes: Axes, at: ContrastMap) -> None:
    """Draw a map; smaller than its pixels, they are averaged."""
    axes.imshow(map_picture(at), aspect="auto", interpolation="antialiased", interpolation_stage="rgba")


def _name_panel(axes: Axes, name: str, words: tuple[str, ...], colour: str) -> None:
    """Write a panel's name and more words above it."""
    size = text_size()
    axes.set_axis_off()
    bold: dict[str, Any] = {"color": colour, "fontweight": "bold"}
    lines: list[tuple[str, dict[str, Any]]] = [(name, bold), *((line, {}) for line in words)]
    for up, (text, style) in enumerate(reversed(lines)):
        axes.annotate(text, (0, 1), xytext=(0, (0.5 + 1.35 * up) * size), xycoords="axes fraction",
                      textcoords="offset points", va="bottom", **style)  # fmt: skip


def _draw_key(figure: Figure, left: float, top: float, columns: int) -> None:
    """Write what the colours mean."""
    handles = [
        Patch(facecolor="white", edgecolor=MUTED, label="visible, and stays visible"),
        Patch(facecolor=LOST, label="visible at full brightness, lost by dimming"),
        Patch(facecolor="black", label="not visible"),
    ]
    full_width, full_height = figure.get_size_inches()
    anchor = (left / full_width, 1 - top / full_height)
    figure.legend(handles=handles, loc="upper left", bbox_to_anchor=anchor, ncols=columns)
