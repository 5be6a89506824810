"""Recorded desktops, dimmed by the loop of `evenlight live` on a simulated panel, in seconds.

`python -m benchmarks.desktops.replay FOLDER docs/pictures` prints the table of docs/live.md, and draws its
figure. Each recording is shown twice, and counted the second time: the way down from full brightness is that
of the begin of a session.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.desktops.made_desktops import DESKTOPS
from evenlight.analysis import figure_style as style
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.instrument_logs import BacklightSetting
from evenlight.data_schema.tracks.loss_curves import LossCurves, read_loss_curves
from evenlight.experiments.desktop.live_loop import LOOKS, LiveLoop, Monitor
from evenlight.experiments.desktop.loss_target import LossTarget, factor_due
from evenlight.experiments.desktop.monitor_dimmer import MonitorDimmer, ScreenLight
from evenlight.experiments.desktop.screens import CHANGED
from evenlight.hardware.backlights import LoggedBacklight
from evenlight.hardware.simulated.panel import SimulatedBacklight
from evenlight.method.contrast.curve_lookup import factor_at_loss, loss_and_slope
from evenlight.method.detectability import watched
from evenlight.method.optimizer.objective import pairwise_spread
from evenlight.method.power import power
from evenlight.method.preset_files import load_power_model, load_rate_limit
from evenlight.method.rate_limit import rate_limit_at, scalar_rate_limit

TARGETS, BUDGET, LOWEST = (0.03, 0.01), 0.7, 0.3  # of the loss, of the power, of the factor
WORK = 0.02  # [s] of an analysis of 1920 x 1080, where the recordings were made
LIMIT = load_rate_limit("surace2025")
POWER = replace(load_power_model("surace2025"), peak_luminance=395.0)  # that of laptop-lcd


@dataclass
class RecordedScreen:
    """What looks at a recording see: as late as the work of analyses makes it, and again from its end on."""

    curves: LossCurves
    output: str = ""
    _seen: ScreenLight | None = None
    _waits_until: float = 0.0

    def look(self, now: float) -> ScreenLight:
        """Return what is on the screen, or was at the last analysis."""
        k = round(now / LOOKS) % self.curves.n_frames
        light = ScreenLight(float(self.curves.mean_luminance[k]), self.curves.loss[k])
        if self._seen is None or (now >= self._waits_until and (light.loss != self._seen.loss).any()):
            self._seen, self._waits_until = light, now + WORK / CHANGED
        return self._seen


def dimmed(curves: LossCurves, loss: float = TARGETS[0], budget: float | None = None) -> Array:
    """Return the factor at each look, (N,): of a loss, or of a budget as a share of the power."""
    now, display, settings = [0.0], curves.display, list[BacklightSetting]()
    panel = LoggedBacklight(SimulatedBacklight(clock := lambda: now[0]), clock, settings.append)
    fastest = scalar_rate_limit(LIMIT, display.reflected_luminance)
    dimmer = MonitorDimmer(panel, clock, fastest, display.peak_luminance, curves.factors, loss, LOWEST)
    due = partial(factor_due, budget or 1.0, POWER)
    target = None if budget is None else LossTarget(dimmer, due, LOWEST)
    monitor = Monitor("", RecordedScreen(curves), dimmer, lambda _: None, target=target)  # type: ignore[arg-type]

    def wait(seconds: float) -> None:
        now[0] += max(seconds, 1e-4)

    loop = LiveLoop([monitor], clock, wait, lambda _: "", lambda _: None, lambda _: None)
    looks = curves.times + curves.n_frames * LOOKS
    while now[0] < looks[-1]:
        loop.run_once()
    at = np.searchsorted([one.ended for one in settings], looks, side="right") - 1
    return np.array([one.achieved for one in settings])[at]


def over_limit(before: Array, after: Array, luminance: Array, seconds: Array) -> Array:
    """Return rates of changes of b over their limits, in pictures of an Ī [cd/m^2] and so many seconds."""
    allowed = np.minimum(*(rate_limit_at(LIMIT, b * luminance) for b in (before, after)))
    return np.asarray((after - before) * luminance / seconds / allowed)


def rows(curves: LossCurves) -> Iterator[list[str]]:
    """Yield the table's rows of a desktop: ways to dim, what each saves and loses, and what is seen of it."""
    ways = {f"{100 * loss:g} % lost": dimmed(curves, loss) for loss in TARGETS}
    ways |= {f"{100 * BUDGET:g} % of the power": dimmed(curves, budget=BUDGET)}
    at_once = factor_at_loss(curves, np.full(curves.n_frames, TARGETS[1]))
    ways |= {f"{100 * TARGETS[1]:g} % lost, at once": np.maximum(at_once, LOWEST)}
    for name, factors in ways.items():
        constant = np.full(curves.n_frames, factors.mean())
        losses = [100 * loss_and_slope(curves, b)[0] for b in (factors, constant)]
        after = np.append(factors[1:], factors[-1])
        ratios = over_limit(factors, after, curves.mean_luminance, curves.durations)
        seen = watched(LIMIT, ratios, curves.durations)
        assert seen is not None
        yield [
            curves.video, name, f"{100 * (1 - factors.mean()):.0f} %", f"{losses[0].mean():.1f}",
            " / ".join(f"{loss.std():.2f}" for loss in losses),
            " / ".join(f"{pairwise_spread(loss):.2f}" for loss in losses),
            " / ".join(f"{100 * share:.0f} %" for share in (seen.noticed, seen.noticed_sensitive)),
            f"{np.abs(ratios).max():.2f}",
        ]  # fmt: skip


def drawn(recordings: list[LossCurves], path: Path) -> None:
    """Draw factor, loss and power over time, a column for each desktop."""
    with style.look():
        full = float(power(POWER, 1.0, np.ones((1, 3)))[0])
        parts = {"factor": 1.0, "contrast loss [%]": None, "power [W]": full}
        title = "Brightness, contrast loss and power on four desktops"
        about = (
            f"Blue: may lose {100 * TARGETS[1]:g} %. Orange: constant dimming, as bright on average. "
            f"Power: the paper's model, at most {full:.2f} W."
        )
        mosaic = [[f"{part} {curves.video}" for curves in recordings] for part in parts]
        figure, axes = style.panels(title, about, mosaic, [9.0] * 3, 2.0, sharex=True)
        for curves in recordings:
            factors, minutes = dimmed(curves, TARGETS[1]), curves.times / 60
            constant = np.full(curves.n_frames, factors.mean())
            for b, colour in ((constant, style.BASELINE), (factors, style.OURS)):
                loss = 100 * loss_and_slope(curves, b)[0]
                shown = (b, loss, power(POWER, b, curves.channel_means))
                for part, values in zip(parts, shown, strict=True):
                    axes[f"{part} {curves.video}"].plot(minutes, values, color=colour, lw=1.1)
            axes[f"factor {curves.video}"].set_title(curves.video, loc="left", fontweight="bold")
            axes[f"power [W] {curves.video}"].set_xlabel("time [min]")
            for part, highest in parts.items():
                axes[f"{part} {curves.video}"].set_ylim(0.0, highest)
        for part, (first, *_) in zip(parts, mosaic, strict=True):
            axes[first].set_ylabel(part)
        style.write_figure(path, figure)


def main(folder: str, pictures: str) -> None:
    """Print the table, and draw the figure."""
    recordings = [
        read_loss_curves(Path(folder) / f"{name}.npz")
        for name in DESKTOPS
        if (Path(folder) / f"{name}.npz").exists()
    ]
    for curves in recordings:
        for row in rows(curves):
            print(f"| {' | '.join(row)} |")
    drawn(recordings, Path(pictures) / "live.png")


if __name__ == "__main__":
    main(*sys.argv[1:])
