"""The numbers that are drawn in the figures of visual adaptation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from evenlight.analysis.reproduction.adaptation_differences import AdaptationInput, Dimming, Place
from evenlight.analysis.reproduction.adaptation_figure import Results, bar_edges, bars
from evenlight.analysis.reproduction.adaptation_step_figure import Change
from evenlight.data_schema.statistic import Origin, PlottedPoint


def histogram_points(
    sequences: Sequence[AdaptationInput], results: Results, origin: Origin
) -> tuple[PlottedPoint, ...]:
    """Return the bars of the histograms, each at its middle on the logarithmic axis."""
    points, edges = [], bar_edges()
    middles = np.sqrt(edges[:-1] * edges[1:])
    for sequence in sequences:
        for place in Place:
            for dimming in Dimming:
                found = results[sequence.name, dimming, place]
                for middle, share in zip(middles, bars(found), strict=True):
                    points.append(
                        PlottedPoint(
                            f"{sequence.name}, {place.value}", dimming.value, "", float(middle),
                            min(float(share), 1.0), "difference of the responses", "1",
                            "share of time", "1", origin, n=found.n_frames,
                        )
                    )  # fmt: skip
                points.append(
                    PlottedPoint(
                        f"{sequence.name}, {place.value}", f"{dimming.value}, mean", "", found.mean, None,
                        "difference of the responses", "1", "share of time", "1", origin, n=found.n_frames,
                    )
                )  # fmt: skip
    return tuple(points)


def step_points(changes: Sequence[Change]) -> tuple[PlottedPoint, ...]:
    """Return the responses of the figure of one change."""
    return tuple(
        PlottedPoint(
            change.name, series, "", float(time), float(value), "time", "s", "cone response", "1",
            Origin.COMPUTED,
        )
        for change in changes
        for series, values in (("static", change.static), ("dynamic", change.dynamic))
        for time, value in zip(np.round(change.times, 6), values, strict=True)
    )  # fmt: skip
