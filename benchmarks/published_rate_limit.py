"""The paper's calibration: the eight thresholds of its figure, and the rate limit that they make.

`python -m benchmarks.published_rate_limit` writes `surace2025` again.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

from evenlight.analysis.calibration.rate_limit.rate_limit_fit import RateLimitFit, fit_points
from evenlight.analysis.published import published, published_values
from evenlight.data_schema.display import Display
from evenlight.data_schema.mapping import mapping_from_record, record_from_mapping
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.recordings.ramp import Direction, Procedure
from evenlight.data_schema.storage.text_files import write_json_record

# Varjo XR-3, ramps of 5 s, 75 % detection; data behind the figure of Section 3.4, from the authors' program.
_THRESHOLDS = published_values("authors_thresholds")
PUBLISHED_LUMINANCE = tuple(
    v.number for v in _THRESHOLDS if v.name.endswith(".luminance")
)  # initial L [cd/m^2]
PUBLISHED_DROP = tuple(v.number for v in _THRESHOLDS if v.name.endswith(".drop"))  # over the ramp [cd/m^2]
PUBLISHED_RAMP_DURATION = published("ramp.duration").number  # [s]

SIGNIFICANT_DIGITS = 12  # below them, linear-algebra libraries differ
SOURCE = (
    "Surace, Condor, Didyk: eight detection thresholds (75 %, yes/no, falling ramps of 5 s) on the Varjo "
    "XR-3 (Section 3.4), 10 participants; ordinary least squares on ln(rate), pointwise band from the 3 "
    "residual degrees of freedom"
)


def published_rates() -> tuple[float, ...]:
    """Return the published thresholds ΔL [cd/m^2/s]: the decrease divided by the ramp's duration.

    >>> published_rates()[0]
    0.26
    """
    return tuple(drop / PUBLISHED_RAMP_DURATION for drop in PUBLISHED_DROP)


def published_fit(display: Display) -> RateLimitFit:
    """Fit the published thresholds as the authors did: all alike, fourth degree, ln(rate) over luminance.

    Parameters
    ----------
    display : Display
        The Varjo XR-3.
    """
    return fit_points(PUBLISHED_LUMINANCE, published_rates(), display, name="surace2025")


def published_rate_limit(display: Display) -> RateLimit:
    """Return the preset `surace2025`, its numbers rounded to what every computer agrees on."""
    limit = dataclasses.replace(
        published_fit(display).limit,
        source=SOURCE,
        procedure=Procedure.YES_NO,  # the text says two-alternative forced choice and describes yes/no
        direction=Direction.DOWN,
        ramp_duration=PUBLISHED_RAMP_DURATION,
    )
    plain = {key: _rounded(value) for key, value in mapping_from_record(limit).items()}
    return record_from_mapping(RateLimit, plain, "the published rate limit")


def _rounded(value: object) -> object:
    """Return a plain value with its numbers rounded to `SIGNIFICANT_DIGITS` digits."""
    if isinstance(value, list):
        return [_rounded(v) for v in value]
    return float(f"{value:.{SIGNIFICANT_DIGITS}g}") if isinstance(value, float) else value


def write_preset() -> Path:
    """Write the preset `surace2025` into `method/presets` and return its path."""
    from evenlight.method.preset_files import PRESETS, load_display

    path = PRESETS / "surace2025.rate_limit.json"
    write_json_record(path, published_rate_limit(load_display("varjo-xr3")))
    return path


if __name__ == "__main__":
    print(write_preset())
