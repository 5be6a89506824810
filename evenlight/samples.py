"""Data to try things on: a short clip, and simulated answers to each experiment.

>>> from evenlight import samples
>>> samples.ratings().columns.tolist()
['participant_id', 'trial_index', 'sequence', 'version', 'rating', 'simulated']

Nobody answered here: the tables are drawn from the effects that each function names, the same each time, and
their column `simulated` labels all that is made of them. Nothing is downloaded, and nothing lies in the
package: each is made when it is asked for.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from evenlight.data_schema.arguments import path, whole
from evenlight.method.preset_files import load_rate_limit
from evenlight.method.psychometric import PsychometricFunction, yes_probability
from evenlight.stimuli.video_writer import write_video

SEED = 1
SEQUENCES = ("library", "gym", "living_room", "basement")
LUMINANCES = (20.0, 45.0, 100.0)  # [cd/m^2], of a white screen on the varjo-xr3
RATES = 0.008 * 1.55 ** np.arange(8)  # of the luminance, a second
PLACES = 12  # of rings, in a search


def clip(folder: str | PathLike[str] | None = None) -> Path:
    """Write a clip of 3 s, 320 x 180 at 25 Hz, and return its file: a lamp that passes over a wall.

    Parameters
    ----------
    folder : str or path, optional
        Where clip.mkv goes; else a new folder among the computer's temporary files.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    made_in = Path(tempfile.mkdtemp(prefix="evenlight-")) if folder is None else path("folder", folder)
    write_video(made_in / "clip.mkv", _frames(), 25.0)
    return made_in / "clip.mkv"


def _frames() -> Iterator[NDArray[np.uint8]]:
    y, x = np.mgrid[:180, :320] / 180
    bricks = 0.5 + 0.2 * np.sin(40 * x) * np.sin(25 * y) + 0.15 * np.sin(150 * x) * np.sin(130 * y)
    for shown in range(75):
        lamp = 0.06 + np.exp(-((x - 1.78 * shown / 74) ** 2 + (y - 0.4) ** 2) / 0.2)
        light = np.clip(bricks * lamp, 0, 1) ** (1 / 2.2)
        yield (255 * light[..., None] * np.array([1.0, 0.95, 0.85])).astype(np.uint8)


def ramps(participants: int = 8) -> pd.DataFrame:
    """Return simulated answers "yes" or "no" to ramps of a white screen, for `evenlight.fit_ramps`.

    The truth: thresholds scatter by 0.3 in ln(rate) about the published rate limit, widths are 1.6, guess and
    lapse rates 5 and 2 %.
    """
    rng, limit = np.random.default_rng(SEED), load_rate_limit("surace2025")
    rows: list[dict[str, Any]] = []
    for who in _people(participants):
        sensitivity = math.exp(0.3 * rng.standard_normal())
        for luminance, rate in rng.permutation([(L, r) for L in LUMINANCES for r in (0.0, *RATES) * 6]):
            eye = PsychometricFunction(sensitivity * float(limit(luminance)), 1.6, 0.05, 0.02)
            seen = rng.random() < float(yes_probability(rate * luminance, eye))
            ramp = {"luminance_cd_m2": luminance, "rate_cd_m2_s": rate * luminance, "duration_s": 5.0}
            rows.append(_row(who, **ramp, response="yes" if seen else "no"))
    return pd.DataFrame(rows)


def ratings(participants: int = 20) -> pd.DataFrame:
    """Return simulated ratings of detail from 1 to 5, for `evenlight.analyze`.

    The truth: the track ("ours") is 0.5 points better than constant dimming ("baseline"), people's own levels
    scatter by 0.5 and ratings by 0.8 points.
    """
    rng = np.random.default_rng(SEED + 1)
    rows: list[dict[str, Any]] = []
    for who in _people(participants):
        own = 3.0 + 0.5 * rng.standard_normal()
        for sequence in rng.permutation(SEQUENCES).tolist():
            for version in rng.permutation(["ours", "baseline"]).tolist():
                quality = own + 0.5 * (version == "ours") + 0.8 * rng.standard_normal()
                given = int(np.clip(round(quality), 1, 5))
                place = sum(row["participant_id"] == who for row in rows)
                rows.append(_row(who, trial_index=place, sequence=sequence, version=version, rating=given))
    return pd.DataFrame(rows)


def comparisons(participants: int = 20) -> pd.DataFrame:
    """Return simulated answers to "in which interval did the brightness change?", for `evenlight.analyze`.

    The truth: nobody sees a difference; each answer is a guess.
    """
    rng = np.random.default_rng(SEED + 2)
    return pd.DataFrame(
        _row(who, trial_index=2 * k + n, sequence=sequence, ours_interval=interval, response=str(answer))
        for who in _people(participants)
        for k, sequence in enumerate(SEQUENCES)
        for n, interval in enumerate(rng.permutation([1, 2]).tolist())
        for answer in [rng.choice(["first", "second"])]
    )


def searches(participants: int = 20) -> pd.DataFrame:
    """Return simulated times of ring searches [s], for `evenlight.analyze`.

    The truth: ln(time) falls by 0.4 for each unit of ln(brightness factor), people scatter by 0.3, places by
    0.4, searches by 0.5; 30 s are the limit.
    """
    rng = np.random.default_rng(SEED + 3)
    hard, gains = 0.4 * rng.standard_normal(PLACES), np.linspace(-0.3, 0.3, PLACES)
    rows: list[dict[str, Any]] = []
    for who in _people(participants):
        own = 1.8 + 0.3 * rng.standard_normal()
        for place, version in rng.permutation([(k, v) for k in range(PLACES) for v in (0, 1)]).tolist():
            brightness = version * gains[place]  # ln of the factor over that of constant dimming, 0.5
            seconds = math.exp(own + hard[place] - 0.4 * brightness + 0.5 * rng.standard_normal())
            rows.append(
                _row(
                    who, sequence=SEQUENCES[place % 4], keypoint=f"place{place}",
                    version="ours" if version else "baseline", factor=0.5 * math.exp(brightness),
                    found=seconds < 30, search_time_s=min(seconds, 30.0), time_limit_s=30.0,
                )
            )  # fmt: skip
    return pd.DataFrame(rows)


def _people(participants: int) -> list[str]:
    return [f"{number:02d}" for number in range(1, whole("participants", participants, 1) + 1)]


def _row(who: str, **columns: Any) -> dict[str, Any]:
    return {"participant_id": who, **columns, "simulated": True}
