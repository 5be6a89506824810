"""What the presets' own numbers of ramps recover: the second table of docs/decisions/placement.md.

Run with `python benchmarks/studies/preset_recovery.py [PARTICIPANTS]`; 4000 take fifteen minutes on one core.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from odd_observers import Flat, Lapsing, WeibullShaped, changed_into
from recovered_thresholds import MODES, Mode, recover
from studies import Mapped, run_study

from evenlight.experiments.design_files import load_design
from evenlight.experiments.ramp.ramp_observer import SimulatedObserver

SEED = 11
PRESETS = {
    "yes_no_targeted": MODES["yes/no, targeted"],
    "recommended": MODES["two intervals, targeted"],
    "psi_marginal": MODES["two intervals, psi-marginal"],
}
ODD: dict[str, type[SimulatedObserver]] = {
    "a Weibull function": WeibullShaped,
    "a width of 3.2": Flat,
    "lapses of 6 %": Lapsing,
}


def main(participants: int, mapped: Mapped = map) -> None:
    """Print the table."""
    print("| preset | ramps | observers | bias | ± | coverage | scatter | stated |\n" + "|---" * 8 + "|")
    for preset, mode in PRESETS.items():
        _row(preset, mode, "as the population", SimulatedObserver, participants, mapped)
    for preset in ("recommended", "psi_marginal"):
        for words, kind in ODD.items():
            _row(preset, PRESETS[preset], words, kind, participants, mapped)


def _row(
    preset: str, mode: Mode, words: str, kind: type[SimulatedObserver], participants: int, mapped: Mapped
) -> None:
    """Print the row of a preset and a kind of participants."""
    ramps = load_design(preset).trials_per_level
    found = recover(mode, ramps, participants, SEED, partial(changed_into, kind), mapped)
    stated = float(np.sqrt(np.mean(found.stated**2)))
    print(
        f"| `{preset}` | {ramps} | {words} | {found.bias:+.1%} | {found.bias_error:.1%} | "
        f"{found.coverage:.1%} | {found.scatter:.3f} | {stated:.3f} |",
        flush=True,
    )


if __name__ == "__main__":
    run_study(__file__, participants=4000)
