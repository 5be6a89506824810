"""Bias of the joint model's curve and coverage of its bands: the table of docs/decisions/joint-model.md.

Run with `python benchmarks/studies/joint_coverage.py`; forty data sets take about a minute on one core.
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from collections import Counter
from functools import partial
from typing import Any

import numpy as np
from joint_recovery import TRUTHS, Recovered, Study, individual_errors, recovered
from studies import Mapped, run_study

from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions
from evenlight.data_schema.errors import InputError
from evenlight.experiments.ramp.ramp_observer import ObserverPopulation

COLUMNS = (
    "design",
    "truth",
    "sets",
    "whole curve covered",
    "pointwise",
    "bias",
    "against those drawn",
    "largest local bias",
    "half-width",
    "people covered",
    "falls",
    "shapes",
    "CPU s per set",
)


def main(mapped: Mapped = map, **options: Any) -> None:
    """Print the table."""
    asked = argparse.Namespace(**options)
    print("| " + " | ".join(COLUMNS) + " |\n" + "|---" * len(COLUMNS) + "|")
    for design in asked.design:
        for truth in asked.truth:
            people = ObserverPopulation()
            if asked.width:
                people = dataclasses.replace(people, width_median=asked.width)
            if asked.participant_sd:
                people = dataclasses.replace(people, participant_sd=asked.participant_sd)
            study = Study(design, truth, asked.participants, people, asked.scale, asked.repeat_share)
            print(_row(study, asked, mapped), flush=True)
            if asked.individual:
                _print_individual(study, asked, mapped)


def _declare(parser: argparse.ArgumentParser) -> None:
    """Add what the command line may ask for."""
    parser.add_argument("--sets", type=int, default=40)
    parser.add_argument("--design", nargs="+", default=["paper", "recommended"])
    parser.add_argument("--truth", nargs="+", choices=list(TRUTHS), default=list(TRUTHS))
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--participants", type=int, default=10)
    parser.add_argument("--width", type=float, help="median width of the people's yes/no functions")
    parser.add_argument("--participant-sd", type=float, help="of ln(threshold) between people's eyes")
    parser.add_argument("--individual", action="store_true", help="the individual fits' bias too (slow)")
    parser.add_argument("--scale", type=float, default=1.0, help="of all thresholds")
    parser.add_argument("--repeat-share", type=float, default=0.0, help="of answers that are the last again")
    parser.add_argument("--monotone", action="store_true")


def _individual_error(study: Study, seed: int) -> float | None:
    """Return the mean error of the individual fits' curve of a data set, or None if it is refused."""
    try:
        return float(individual_errors(*study.answers(seed)).mean())
    except InputError:
        return None


def _print_individual(study: Study, asked: argparse.Namespace, mapped: Mapped) -> None:
    """Print the bias of the individual fits' curve against the people drawn, and what it leaves out."""
    found = [*mapped(partial(_individual_error, study), range(asked.seed, asked.seed + asked.sets))]
    errors = [error for error in found if error is not None]
    refused = len(found) - len(errors)
    error = np.std(errors, ddof=1) / len(errors) ** 0.5
    print(
        f"individual fits: {np.mean(errors):+.1%} ± {error:.1%} of {len(errors)}, {refused} refused",
        flush=True,
    )


def _timed(study: Study, options: RateLimitOptions, seed: int) -> tuple[Recovered, float]:
    """Return what is found of a data set, and in how much processor time [s]."""
    began = time.process_time()
    return recovered(study, seed, options), time.process_time() - began


def _row(study: Study, asked: argparse.Namespace, mapped: Mapped) -> str:
    """Return the row of a study."""
    recover = partial(_timed, study, RateLimitOptions(monotone=asked.monotone))
    found, times = zip(*mapped(recover, range(asked.seed, asked.seed + asked.sets)), strict=True)
    seconds = np.mean(times)
    errors = np.array([one.errors for one in found])
    share = np.mean([one.covered for one in found])
    own = np.array([one.own_errors.mean() for one in found])
    per_set = errors.mean(axis=1)
    local = errors.mean(axis=0)
    worst = int(np.argmax(np.abs(local)))
    noise = errors[:, worst].std(ddof=1) / len(found) ** 0.5
    held = np.array([one.people for one in found])
    shapes = Counter(f"{one.fit.basis.form.value} {one.fit.basis.degree}" for one in found)
    falls = sum(any("falls" in note for note in one.fit.notes) for one in found)
    at = found[0].fit.band_luminance[worst]
    cells = (
        study.design,
        study.truth,
        str(len(found)),
        f"{share:.1%} ± {(share * (1 - share) / len(found)) ** 0.5:.1%}",
        f"{np.mean([one.pointwise for one in found]):.1%}",
        f"{per_set.mean():+.1%} ± {per_set.std(ddof=1) / len(found) ** 0.5:.1%}",
        f"{own.mean():+.1%} ± {own.std(ddof=1) / len(found) ** 0.5:.1%}",
        f"{local[worst]:+.1%} ± {noise:.1%} at {at:.0f}",
        f"{np.mean([one.half_width for one in found]):.3f}",
        f"{held.mean():.1%} ± {held.mean(axis=1).std(ddof=1) / len(found) ** 0.5:.1%}",
        str(falls),
        ", ".join(f"{name}: {count}" for name, count in shapes.most_common()),
        f"{seconds:.1f}",
    )
    return "| " + " | ".join(cells) + " |"


if __name__ == "__main__":
    run_study(__file__, _declare)
