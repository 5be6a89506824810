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
from PIL import Image

from evenlight.analysis import figure_style as style
from evenlight.analysis.figure_style import PAGE
from evenlight.analysis.tracks.frame_samples import small_picture, square_means
from evenlight.analysis.tracks.track_words import lost
from evenlight.data_schema.arrays import Mask
from evenlight.data_schema.contrast_model import ContrastModel, LossForm
from evenlight.data_schema.display import Display
from evenlight.method.contrast.contrast_loss import counted_map, loss_of
from evenlight.method.contrast.luminance import dimmed_luminance, emitted_luminance
from evenlight.method.contrast.pyramid import counted_frequencies
from evenlight.stimuli.video.frame_conversion import linear_light

SHOWN_SHARE = 0.01  # of the pixels must be visible for a band to be worth showing
WIDEST_MAP = 1280  # [pixels]; a panel of the figure has fewer
KEPT, GONE = "#B4BAC2", "#D0001A"  # on white: red lines a pixel wide are seen, in print too


@dataclass(frozen=True, slots=True)
class ContrastMap:
    """Where a frame's contrast is visible in one band, at full brightness and dimmed."""

    factor: float  # b
    frequency: float  # of the band [cpd]
    reference: Mask  # where contrast is visible at full brightness, (height, width)
    dimmed: Mask  # and where it is when dimmed by b
    loss: float  # 𝓛_c of the frame, over all bands
    averaged: bool = False  # whether finer detail than the frequency was left out

    @property
    def lost(self) -> Mask:
        """Where contrast is visible at full brightness only."""
        return self.reference & ~self.dimmed

    @property
    def lost_share(self) -> float:
        """Share of the band's visible contrast that is lost; 0 where nothing is visible."""
        visible = int(self.reference.sum())
        return float(self.lost.sum()) / visible if visible else 0.0


def contrast_maps(
    pixel_values: NDArray[Any],
    at: Sequence[tuple[float, float | None]],
    display: Display,
    model: ContrastModel,
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
        The display, with its pixels per degree as in the analysis of the video; choices of the model.
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
    return float(np.mean([band.mean() for band in bands]))


def contrast_map_figure(
    pixel_values: NDArray[Any],
    ours: ContrastMap,
    baseline: ContrastMap,
    name: str,
    labels: tuple[str, str] = ("the track", "constant"),
) -> Figure:
    """Draw a frame, and which of its contrast is visible and which is lost under two brightness factors.

    Parameters
    ----------
    pixel_values, name : array, (height, width, 3), str
        The frame, as in `Frame`, and what it is called, e.g. "bikes.mp4 at 4.2 s".
    ours, baseline : ContrastMap
        At the track's factor, and at that of constant dimming.
    """
    with style.look():
        em, gap = PAGE.em, 1.2 * PAGE.em
        rows, columns = ours.reference.shape
        cell = (PAGE.width - 2 * em - 2 * gap) / 3
        high = min(cell * rows / columns, 0.7 * PAGE.height)
        wide = high * columns / rows
        lines, above = style.heading_lines(*_heading(ours, name), PAGE.width - 2 * em, em)
        top = above + 5.2 * em
        figure = style.new_figure(top + high + 3.2 * em)
        style.lines_at(figure, em, lines)
        panels = [style.axes_at(figure, em + k * (cell + gap), top, wide, high) for k in range(3)]
        panels[0].imshow(small_picture(pixel_values, 640), aspect="auto")
        _name_panel(panels[0], "full brightness", ("the frame", ""), style.MUTED)
        for panel, at, label, colour in (
            (panels[1], ours, labels[0], style.OURS),
            (panels[2], baseline, labels[1], style.BASELINE),
        ):
            panel.imshow(map_picture(at, round(wide * PAGE.dots_per_inch)), aspect="auto")
            losses = f"lost of these: {100 * at.lost_share:.1f} %", f"lost of all: {lost(at.loss)}"
            _name_panel(panel, f"{label}, b = {at.factor:.2f}", losses, colour)
        anchor = (em / PAGE.width, 1 - (top + high + 0.8 * em) / figure.get_figheight())
        keys = [
            Patch(facecolor=KEPT, label="visible, and stays visible"),
            Patch(facecolor=GONE, label="visible at full brightness, lost by dimming"),
            Patch(facecolor="white", edgecolor=style.MUTED, label="not visible"),
        ]
        figure.legend(handles=keys, loc="upper left", bbox_to_anchor=anchor, ncols=3)
    return figure


def _heading(ours: ContrastMap, name: str) -> tuple[str, str]:
    title = f"Visible contrast of {name}"
    if not ours.reference.any():
        return title, "Nothing in this frame is visible, even at full brightness."
    finest = "the finest that is drawn" if ours.averaged else "the finest with visible contrast"
    return title, f"Details at {ours.frequency:.3g} cpd (cycles per degree), {finest}."


def map_picture(at: ContrastMap, widest: int = WIDEST_MAP) -> NDArray[np.float64]:
    """Return the map in colours, (h, w, 3): visible contrast grey, lost contrast red, the rest white.

    Wider than can be shown, its pixels are averaged: then lines a pixel wide are drawn stronger than their
    share of the area, so that they are seen, and lost contrast over that which stays.
    """
    rows, columns = at.reference.shape
    width = min(widest, columns)
    size = width, max(1, round(rows * width / columns))
    picture = np.ones((*size[::-1], 3))
    for mask, colour, stronger in ((at.reference & at.dimmed, KEPT, 1.5), (at.lost, GONE, 3.0)):
        share = Image.fromarray(mask.astype(np.float32)).resize(size, Image.Resampling.BOX)
        cover = np.minimum(stronger * np.asarray(share, dtype=np.float64), 1.0)[..., None]
        picture = (1 - cover) * picture + cover * to_rgb(colour)
    return picture


def _name_panel(axes: Axes, name: str, words: tuple[str, ...], colour: str) -> None:
    size = style.text_size()
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set(visible=True, color=style.FAINT)  # "not visible" is as white as the page
    for up, text in enumerate(reversed((name, *words))):
        bold: dict[str, Any] = {"color": colour, "fontweight": "bold"} if up == len(words) else {}
        at = 0, (0.5 + 1.35 * up) * size
        axes.annotate(text, (0, 1), at, "axes fraction", "offset points", va="bottom", **bold)
