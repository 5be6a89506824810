"""Savings measured on simulated devices: how often the 95 % interval holds the truth, and how wide it is.

The power of each device drifts, straight or as it warms up, and wanders (an Ornstein-Uhlenbeck process). Its
gauge smooths over seconds, is renewed every two, and is read once a second in steps of 10 mW. Before each
version a person needs some seconds, in which another picture stands.
`python benchmarks/studies/saving_coverage.py` prints the table of docs/decisions/saving-on-a-device.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.signal import lfilter
from studies import Mapped, run_study

from evenlight.analysis.played_power.pass_power import PassComparison
from evenlight.data_schema.recordings.played_power import DevicePass
from evenlight.hardware.device_passes import VERSIONS, PassRequest

READ_EVERY, RENEWED_EVERY = 1, 2  # [s]
PAUSE = 15  # [s] between two versions
MENU = 0.7  # share of full power that the device takes in it


@dataclass(frozen=True)
class Device:
    """What is true of a device and a measurement."""

    saving: float = 0.2
    full_power: float = 5.0  # [W] of the whole device
    drift: float = -0.1  # share of the power in an hour
    warm_up: float = 0.0  # share of the power that goes in the first ten minutes, exponentially
    wander: float = 0.02  # standard deviation of what else the device does, as a share
    wander_time: float = 30.0  # [s] of its correlation
    lag: float = 5.0  # [s] of the gauge's smoothing
    step: float = 0.01  # [W] of the gauge
    rounds: int = 6
    seconds: int = 120
    settle: int = 15


def measured_passes(device: Device, rng: np.random.Generator) -> list[DevicePass]:
    """Return the passes, as the command measures them."""
    seed = int(rng.integers(2**32))
    order = PassRequest("", {}, device.rounds, device.seconds, device.settle, READ_EVERY, "", seed).order()
    length = PAUSE + device.seconds
    times = np.arange(length * len(order))
    film = 1 + 0.1 * np.sin(2 * np.pi * np.arange(device.seconds) / 40)  # the picture changes
    shown = {"full": film, "dimmed": film * (1 - device.saving)}
    level = np.concatenate([np.append(np.full(PAUSE, MENU), shown[version]) for version in order])
    keep = np.exp(-1 / device.wander_time)
    shocks = rng.standard_normal(times.size)
    shocks[1:] *= np.sqrt(1 - keep**2)
    slow = 1 + device.drift * times / 3600 + device.warm_up * np.exp(-times / 200)
    power = device.full_power * level * slow * (1 + device.wander * lfilter([1], [1, -keep], shocks))
    pull = 1 - np.exp(-1 / device.lag)
    smooth = lfilter([pull], [1, pull - 1], power, zi=[(1 - pull) * power[0]])[0]
    gauge = np.round(smooth[times - times % RENEWED_EVERY] / device.step) * device.step
    counted = device.seconds - device.settle
    return [
        DevicePass(
            k,
            version,
            float(end - counted),
            float(counted),
            float(gauge[end - counted : end].mean()),
            counted,
            0,
            2.0,
        )
        for k, (version, end) in enumerate(zip(order, length * np.arange(1, len(order) + 1), strict=True))
    ]


def coverage(device: Device, n: int, seed: int) -> tuple[float, float, float]:
    """Return the share of intervals that hold the truth, their mean width, and the bias, in shares."""
    rng = np.random.default_rng(seed)
    found = [PassComparison(measured_passes(device, rng), VERSIONS).saving("dimmed") for _ in range(n)]
    ends = np.array([one.interval() for one in found if one is not None])
    held = (ends[:, 0] <= device.saving) & (device.saving <= ends[:, 1])
    bias = np.mean([one.value for one in found if one is not None]) - device.saving
    return float(held.mean()), float(np.diff(ends).mean()), float(bias)


CASES = {
    "saving 20 %": Device(),
    "saving 0 %": Device(saving=0.0),
    "saving 5 %": Device(saving=0.05),
    "quiet device (0.5 %)": Device(wander=0.005),
    "drift 30 %/h": Device(drift=-0.3),
    "warm-up of 10 %": Device(warm_up=0.1),
    "wanders over 5 min": Device(wander_time=300.0),
    "lag 20 s, settled 60 s": Device(lag=20.0, settle=60),
    "lag 5 s, not settled": Device(settle=0),
    "3 rounds": Device(rounds=3),
    "12 rounds": Device(rounds=12),
    "6 rounds of 10 min": Device(seconds=600),
}


def main(n: int, mapped: Mapped = map) -> None:
    """Print the table."""
    print(f"| device ({n} measurements each) | holds the truth [%] | mean width [points] | bias [points] |")
    print("|---|---|---|---|")
    found = mapped(partial(coverage, n=n, seed=21), CASES.values())
    for name, (held, width, bias) in zip(CASES, found, strict=True):
        print(f"| {name} | {100 * held:.1f} | {100 * width:.2f} | {100 * bias:+.2f} |", flush=True)


if __name__ == "__main__":
    run_study(__file__, n=400)
