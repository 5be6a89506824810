"""How near energies of frames come to a simulated truth: for docs/decisions/power-synchronisation.md.

Run with `python benchmarks/studies/frame_energy_recovery.py [PLAYINGS]`; 100 take five minutes on one core.
"""

from __future__ import annotations

import dataclasses
from functools import partial

import numpy as np
from played_power_truth import Conditions, play, times_of
from studies import Mapped, run_study

from evenlight.analysis.played_power.clock_fit import fit_clock
from evenlight.analysis.played_power.clock_line import line_of
from evenlight.analysis.played_power.pass_power import frame_energies
from evenlight.data_schema.arrays import Array

CLOCKS = {
    "edges": Conditions(frames=600),
    "pings": Conditions(frames=600, has_sync=False),
    "flash markers": Conditions(frames=600, has_sync=False, has_pings=False),
    "none": Conditions(frames=600),
}


def main(playings: int, mapped: Mapped = map) -> None:
    """Print the table."""
    print(
        "| clock by | content | noise [mW] | rate [Hz] | worst | 95 % | mean | above 1 % | whole | "
        "clock off [ms] |"
    )
    print("|---" * 10 + "|")
    asked = []
    for name, conditions in CLOCKS.items():
        for content in ("ramps", "cuts"):
            for noise in (0.0, 0.001, 0.005) if name == "edges" else (0.0,):
                for rate in (100.0, 500.0, 1000.0):
                    varied = {"content": content, "noise": noise, "sample_rate": rate}
                    asked.append((name, dataclasses.replace(conditions, **varied)))
    for row in mapped(partial(_row, playings), *zip(*asked, strict=True)):
        print(row, flush=True)


def _row(playings: int, name: str, conditions: Conditions) -> str:
    """Return a row."""
    single, whole, off = [], [], []
    for seed in range(playings):
        truth = play(conditions, np.random.default_rng(seed))
        recording = truth.recording
        line = line_of(fit_clock(recording))
        frames = frame_energies(recording.samples, recording.flips, conditions.refresh_rate, line)
        begun, ended = times_of(frames)
        true = truth.energy(ended) - truth.energy(begun)
        if name == "none":
            energy = _unsynchronised(
                recording.samples.received[0], recording.samples.power, conditions, begun, ended
            )
        else:
            energy = np.array([np.nan if frame.energy is None else frame.energy for frame in frames])
            played = recording.flips.flip[[0, -1]]
            off.append(np.abs(truth.to_computer(line.to_meter(played)) - played).max())
        kept = np.isfinite(energy)
        single.append(np.abs(energy / true - 1)[kept])
        whole.append(abs(energy[kept].sum() / true[kept].sum() - 1))
    error = np.concatenate(single)
    clock = f"{1000 * max(off):.2g}" if off else ""
    return (
        f"| {name} | {conditions.content} | {1000 * conditions.noise:g} | {conditions.sample_rate:g} | "
        f"{error.max():.2%} | {np.quantile(error, 0.95):.3%} | {error.mean():.3%} | "
        f"{np.mean(error > 0.01):.3%} | {max(whole):.4%} | {clock} |"
    )


def _unsynchronised(first: float, power: Array, conditions: Conditions, begun: Array, ended: Array) -> Array:
    """Return energies by samples taken as evenly spaced from the first arrival, each as an instant."""
    times = first + np.arange(len(power)) / conditions.sample_rate
    energy = np.concatenate([[0.0], np.cumsum(np.diff(times) * (power[1:] + power[:-1]) / 2)])
    return np.asarray(np.interp(ended, times, energy) - np.interp(begun, times, energy))


if __name__ == "__main__":
    run_study(__file__, playings=100)
