"""What the two responses are: one change of brightness, at once and at the pace of the rate limit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from evenlight.analysis.figure_style import (
    INK,
    LIMIT,
    MUTED,
    OURS,
    PAGE,
    axes_at,
    heading_lines,
    lines_at,
    look,
    new_figure,
)
from evenlight.data_schema.arrays import Array
from evenlight.method.adaptation import (
    adapted,
    cone_response,
    response_differences,
    state_after,
    static_response,
)

BEFORE, AFTER = 40.0, 20.0  # [cd/m^2] a frame of middling brightness, and its half
PACE = 0.03  # [1/s] about the published limit there, relative to the luminance
STEP = 0.002  # [s] between the moments that are drawn


@dataclass(frozen=True, slots=True)
class Change:
    """A change of luminance, and what the cones make of it, at M moments.

    Attributes
    ----------
    name : str
        What it is called.
    times : array, (M,)
        Moments [s]; it begins at 0.
    static, dynamic : array, (M,)
        Responses, in [0, 1].
    integral : float
        Of their difference over all time shown [s].
    """

    name: str
    times: Array
    static: Array
    dynamic: Array
    integral: float

    @property
    def largest(self) -> float:
        """Largest difference at any of the moments."""
        return float(np.abs(self.static - self.dynamic).max())


def changes() -> tuple[Change, Change]:
    """Return the change at once, and at the pace of the rate limit."""
    ramp = float(np.log(BEFORE / AFTER)) / PACE
    return (
        _change("at once", np.arange(-0.1, 0.5, STEP), lambda t: AFTER if t >= -STEP / 2 else BEFORE),
        _change(
            f"at {100 * PACE:g} % per second", np.arange(-5.0, ramp + 5.0, 20 * STEP),
            lambda t: BEFORE * float(np.exp(-PACE * min(max(t, 0.0), ramp))),
        ),
    )  # fmt: skip


def _change(name: str, times: Array, luminance_at: Callable[[float], float]) -> Change:
    """Return the responses to a luminance over time, constant between moments."""
    luminance = np.array([luminance_at(t) for t in times.tolist()])
    durations = np.full(len(times), times[1] - times[0])
    state, dynamic = adapted(luminance[0]), []
    for light, seconds in zip(luminance, durations, strict=True):
        dynamic.append(cone_response(light, state).item())
        state = state_after(state, light, seconds)
    integral = float(response_differences(luminance, durations).sum())
    return Change(name, times, static_response(luminance), np.array(dynamic), integral)


def step_figure(shown: tuple[Change, Change]) -> Figure:
    """Draw both responses over time, for the change at once and for the slow one."""
    em = PAGE.em
    with look(PAGE):
        left, gap = 5.6 * em, 3.0 * em
        width = (PAGE.width - left - gap - 1.5 * em) / 2
        lines, above = heading_lines(
            "The time integral of the difference does not tell fast from slow",
            f"Cones that have adapted (static) and that adapt (dynamic): a screen dimmed from {BEFORE:g} to "
            f"{AFTER:g} cd/m²",
            PAGE.width - left - em, em,
        )  # fmt: skip
        top, height = above + 2.6 * em, 14 * em
        figure = new_figure(PAGE, top + height + 4.4 * em)
        lines_at(figure, left, lines)
        everything = np.concatenate([part for change in shown for part in (change.static, change.dynamic)])
        low, high = float(everything.min()), float(everything.max())
        for k, change in enumerate(shown):
            axes = axes_at(figure, left + k * (width + gap), top, width, height)
            axes.fill_between(
                change.times, change.static, change.dynamic, color=LIMIT, alpha=0.25, linewidth=0
            )
            axes.plot(change.times, change.static, color=INK, linestyle=(0, (3, 1.4)), label="static")
            axes.plot(change.times, change.dynamic, color=OURS, label="dynamic")
            area = f"area {1000 * change.integral:.1f} ms, gap up to {change.largest:.1g}"
            axes.set_title(f"{change.name}: {area}", loc="left")
            axes.set(
                xlim=(change.times[0], change.times[-1]), xlabel="time [s]",
                ylim=(low - 0.08 * (high - low), high + 0.08 * (high - low)),
            )  # fmt: skip
            if k == 0:
                axes.set_ylabel("cone response R [1]")
                axes.legend(loc="lower right")
            else:
                axes.tick_params(labelleft=False)
                seconds = np.log(BEFORE / AFTER) / PACE
                words = f"the lines all but lie on each other,\nbut for {seconds:.0f} s: about the same area"
                axes.text(
                    0.97, 0.06, words, color=MUTED, ha="right", transform=axes.transAxes, linespacing=1.4
                )
    return figure
