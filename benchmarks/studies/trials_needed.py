"""How many trials each mode needs for the same precision: the tables of docs/decisions/placement.md.

Run with `python benchmarks/studies/trials_needed.py [PARTICIPANTS]`; 250 take twenty minutes on one core.
"""

from __future__ import annotations

import numpy as np
from recovered_thresholds import MODES, Mode, Recovery, recover
from studies import Mapped, run_study

RAMPS = (24, 32, 48, 64, 96, 160)
WANTED = (0.15, 0.2, 0.25)  # scatter of ln(threshold)
SEED = 3


def ramps_needed(recovered: dict[int, Recovery], wanted: float) -> float:
    """Return the ramps per level at which the scatter is the wanted one, between those simulated.

    The scatter goes about with the root of the number: the interpolation is linear in the logarithms.
    """
    ramps = np.log(list(recovered))
    scatter = np.log([found.scatter for found in recovered.values()])
    order = np.argsort(scatter)
    return float(np.exp(np.interp(np.log(wanted), scatter[order], ramps[order], left=np.inf, right=-np.inf)))


def main(participants: int, mapped: Mapped = map) -> None:
    """Print both tables."""
    print("| mode | ramps | bias | ± | coverage | scatter | stated |\n|---|---|---|---|---|---|---|")
    studies = {name: _study(name, mode, participants, mapped) for name, mode in MODES.items()}
    print("\n| mode |" + "".join(f" {wanted} |" for wanted in WANTED) + "\n|---|" + "---|" * len(WANTED))
    for name, recovered in studies.items():
        needed = [ramps_needed(recovered, wanted) for wanted in WANTED]
        cells = [_in_words(n, MODES[name]) for n in needed]
        print(f"| {name} | " + " | ".join(cells) + " |")


def _study(name: str, mode: Mode, participants: int, mapped: Mapped) -> dict[int, Recovery]:
    """Recover thresholds from sessions of different length, and print a row for each."""
    recovered = {}
    for ramps in RAMPS:
        found = recovered[ramps] = recover(mode, ramps, participants, SEED, mapped=mapped)
        stated = float(np.sqrt(np.mean(found.stated**2)))
        print(
            f"| {name} | {ramps} | {found.bias:+.1%} | {found.bias_error:.1%} | {found.coverage:.1%} | "
            f"{found.scatter:.3f} | {stated:.3f} |",
            flush=True,
        )
    return recovered


def _in_words(ramps: float, mode: Mode) -> str:
    """Return ramps per level and the minutes of a session of ten levels."""
    if not np.isfinite(ramps):
        return f"above {RAMPS[-1]}"
    if ramps == 0:
        return f"below {RAMPS[0]}"
    return f"{ramps:.0f} ({mode.minutes(round(ramps)):.0f} min)"


if __name__ == "__main__":
    run_study(__file__, participants=250)
