"""Figures of light over time: PWM, response, latency; one each, with what they say in the title."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from evenlight.analysis.figure_style import (
    BASELINE,
    FAINT,
    INK,
    LIMIT,
    MUTED,
    OURS,
    PAGE,
    FigureFormat,
    axes_at,
    heading_lines,
    legend_above,
    lines_at,
    look,
    new_figure,
    text_size,
)
from evenlight.analysis.measurement.light.light_edges import Overlay
from evenlight.analysis.measurement.light.light_findings import LightFindings
from evenlight.analysis.report_prose import prose

PERIODS = 4  # of a PWM that are shown
UNKNOWN_SPAN = 0.05  # [s] of the light that is shown where no PWM was found
MOST_POINTS = 4000  # of a line
COLOURS = {True: OURS, False: BASELINE}  # of rising and falling edges
NAMES = {True: "black to white", False: "white to black"}
Draw = Callable[[Axes, LightFindings], None]


def ripple_figure(findings: LightFindings, medium: FigureFormat = PAGE) -> Figure:
    """Draw some periods of the steady light, and its amplitude spectrum."""
    return _figure("ripple", findings, (_draw_trace, _draw_spectrum), medium)


def response_figure(findings: LightFindings, medium: FigureFormat = PAGE) -> Figure:
    """Draw all edges of each direction laid over each other, with the lines of 10 and 90 %."""

    def drawn(overlay: Overlay) -> Draw:
        return lambda axes, _: _draw_edges(axes, overlay)

    return _figure("response", findings, tuple(drawn(overlay) for overlay in findings.overlays), medium)


def latency_figure(findings: LightFindings, medium: FigureFormat = PAGE) -> Figure:
    """Draw the latency of each edge over time, and how often it was how long."""
    return _figure("latency", findings, (_draw_over_time, _draw_histogram), medium)


def _figure(kind: str, findings: LightFindings, panels: tuple[Draw, ...], medium: FigureFormat) -> Figure:
    """Return a figure with a panel beside the other."""
    title, subtitle = prose("light_titles", kind=kind, results=findings.results, log=findings.recording.log)
    with look(medium):
        em = medium.em
        left, gap = 5.2 * em, 6.0 * em
        width = (medium.width - left - 1.5 * em - gap * (len(panels) - 1)) / len(panels)
        lines, above = heading_lines(title, subtitle, medium.width - left - em, em)
        top, height = above + 2.2 * em, min(20 * em, 0.45 * medium.height)
        figure = new_figure(medium, top + height + 4.0 * em)
        lines_at(figure, left, lines)
        for place, draw in enumerate(panels):
            draw(axes_at(figure, left + place * (width + gap), top, width, height), findings)
    return figure


def _draw_trace(axes: Axes, findings: LightFindings) -> None:
    """Draw the beginning of the steady light, and one period of it on average."""
    times, values = findings.steady
    found = findings.ripple and findings.ripple.ripple.frequency
    span = PERIODS / found if found else UNKNOWN_SPAN
    shown = times <= times[0] + span
    since = 1000 * (times[shown] - times[0])
    axes.plot(
        since, values[shown], ".-", color=FAINT, markerfacecolor=MUTED, markeredgewidth=0, label="samples"
    )
    if findings.ripple and found:
        phases = np.concatenate([findings.ripple.phases + k for k in range(PERIODS)])
        waveform = np.tile(findings.ripple.waveform, PERIODS)
        axes.plot(1000 * phases / found, waveform, color=OURS, label="mean period")
    low, high = min(0.0, float(values.min())), max(0.0, float(values.max()))
    axes.set(xlim=(0, 1000 * span), ylim=(low * 1.08, high * 1.08), xlabel="time [ms]")
    axes.set_ylabel("light [sampler's scale]")
    legend_above(axes)


def _draw_spectrum(axes: Axes, findings: LightFindings) -> None:
    """Draw amplitudes over frequency, the highest of many where there are too many to show."""
    found = findings.ripple
    if found is None:
        return
    size = max(len(found.frequencies) // MOST_POINTS, 1)
    starts = np.arange(0, len(found.frequencies), size)
    axes.loglog(found.frequencies[starts], np.maximum.reduceat(found.amplitudes, starts), color=MUTED)
    axes.loglog(found.frequencies, found.smallest, color=LIMIT, linestyle="--", label="least that is told")
    if found.ripple.frequency:
        height = float(found.amplitudes.max())
        axes.plot(
            [found.ripple.frequency],
            [1.6 * height],
            "v",
            color=OURS,
        )
        axes.set_ylim(top=4 * height)
    axes.set(xlabel="frequency [Hz]", ylabel="amplitude [sampler's scale]")
    axes.set_xlim(found.frequencies[0], found.frequencies[-1])
    legend_above(axes)


def _draw_edges(axes: Axes, overlay: Overlay) -> None:
    """Draw edges laid over each other, their median, and where it passes 10 and 90 %."""
    since, rising = 1000 * overlay.since, overlay.response.rising
    axes.plot(since, overlay.shares.T, color=MUTED, alpha=0.35, linewidth=text_size() / 16)
    axes.plot(
        since, np.median(overlay.shares, axis=0), color=COLOURS[rising], label=f"{NAMES[rising]}, median"
    )
    for share, end in zip((0.1, 0.9), overlay.ends, strict=True):
        axes.axhline(share, color=MUTED, linestyle=":", linewidth=text_size() / 14)
        axes.plot([1000 * end], [share], "o", color=INK)
    axes.set(xlim=(since[0], since[-1]), ylim=(-0.2, 1.2), xlabel="time since the middle [ms]")
    axes.set_ylabel("share of the change")
    legend_above(axes)


def _draw_over_time(axes: Axes, findings: LightFindings) -> None:
    """Draw each edge's latency, and the changes without an edge."""
    recording = findings.recording
    at = recording.flips[1:] - recording.flips[0]
    for rising, colour in COLOURS.items():
        own = recording.lit[1:] == rising
        axes.plot(at[own], 1000 * findings.latencies[own], "o", color=colour, markersize=0.35 * text_size())
        axes.plot([], [], "o", color=colour, label=NAMES[rising].partition(" ")[2])
    missing = ~np.isfinite(findings.latencies)
    if missing.any():
        axes.plot(at[missing], np.zeros(int(missing.sum())), "x", color=LIMIT, label="no edge")
    low, high = axes.get_ylim()
    axes.set(xlabel="time [s]", ylabel="latency [ms]", ylim=(min(low, 0.0), max(1.1 * high, 1.0)))
    legend_above(axes, columnspacing=0.8)


def _draw_histogram(axes: Axes, findings: LightFindings) -> None:
    """Draw how often the latency was how long, for both directions."""
    known = 1000 * findings.latencies[np.isfinite(findings.latencies)]
    step = max(float(np.ptp(known)) / 24, 1000 * findings.recording.period)
    edges = known.min() - step / 2 + step * np.arange(int(np.ptp(known) / step) + 3)
    for rising, colour in COLOURS.items():
        own = findings.latencies[findings.recording.lit[1:] == rising]
        axes.hist(1000 * own[np.isfinite(own)], edges, color=colour, alpha=0.7)
    axes.axvline(float(np.median(known)), color=INK, linestyle=":")
    axes.set(xlabel="latency [ms] (dotted: median)", ylabel="edges")
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
