"""How often the interval of a ratio of spreads holds the truth: walks through made-up content.

The loss under constant dimming is the exponential of an Ornstein-Uhlenbeck process with a given correlation
time, and a controller of the same kind as the paper's follows it. The truth is the mean logarithm of the
ratio over walks as long as the one that is judged.

By hand, with many walks: python benchmarks/studies/online_spread_coverage.py
"""

from __future__ import annotations

import numpy as np
from studies import Mapped, run_study

from evenlight.analysis.tracks.loss_spread import SpreadRatio, spread_ratio
from evenlight.data_schema.arrays import Array

PERIOD = 0.2  # [s] of a frame
MEDIAN, SPREAD = 0.08, 0.5  # of the content's loss at factor 0, and SD of its logarithm
TARGET, GAIN = 0.04, 0.4  # loss to hold; change of the factor per loss and second


def content(seconds: float, correlation_time: float, walks: int, rng: np.random.Generator) -> Array:
    """Return the loss at factor 0, (frames, walks)."""
    kept = np.exp(-PERIOD / correlation_time)
    steps = rng.normal(size=(round(seconds / PERIOD), walks))
    state, path = steps[0], np.empty_like(steps)
    for frame, step in enumerate(steps):
        state = step if frame == 0 else kept * state + np.sqrt(1 - kept**2) * step
        path[frame] = state
    return np.asarray(MEDIAN * np.exp(SPREAD * path))


def walk_ratios(seconds: float, correlation_time: float, walks: int, seed: int) -> list[SpreadRatio]:
    """Return the ratio of each walk: loss at factor b is the content's, times 1 - b."""
    lost = content(seconds, correlation_time, walks, np.random.default_rng(seed))
    factor = np.clip(1 - TARGET / lost[0], 0.2, 1)
    factors = np.empty_like(lost)
    for frame, now in enumerate(lost):
        factor = np.clip(factor + GAIN * PERIOD * (now * (1 - factor) - TARGET), 0.2, 1)
        factors[frame] = factor
    ours, constant = lost * (1 - factors), lost * (1 - factors.mean(axis=0))
    durations = np.full(len(lost), PERIOD)
    return [spread_ratio(x, y, durations) for x, y in zip(ours.T, constant.T, strict=True)]


def coverage(ratios: list[SpreadRatio]) -> float:
    """Return the share of intervals that hold the mean of the logarithms of all ratios."""
    truth = np.exp(np.mean([np.log(r.ratio) for r in ratios if r.ratio]))
    return float(np.mean([r.ci_low <= truth <= r.ci_high for r in ratios if r.ci_low and r.ci_high]))


def told(correlation_time: float) -> str:
    """Return what is found for walks of three minutes through content that changes slowly or fast."""
    ratios = walk_ratios(182.0, correlation_time, 4000, seed=1)
    flagged = np.mean([bool(r.flag) for r in ratios])
    found = np.median([r.correlation_time for r in ratios])
    return f"{correlation_time:4.0f} s: holds {coverage(ratios):.3f}, flagged {flagged:.2f}, time {found:.1f}"


def main(mapped: Mapped = map) -> None:
    """Print the coverage for each correlation time [s]."""
    for line in mapped(told, (2.0, 3.0, 5.0, 8.0, 12.0, 20.0)):
        print(line, flush=True)


if __name__ == "__main__":
    run_study(__file__)
