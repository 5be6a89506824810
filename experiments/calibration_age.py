"""The time of day, and how old a calibration is by it: whether a rig still takes it."""

from __future__ import annotations

from datetime import UTC, datetime

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.power_model import PowerModel

SECONDS_A_DAY = 86400.0


def too_old(calibration: Display | PowerModel, age_limit: float | None, now: str) -> str:
    """Return what is wrong with a calibration's age, in words; empty if it may be used.

    Parameters
    ----------
    calibration : Display or PowerModel
        What was measured.
    age_limit : float or None
        In days; None for no limit.
    now : str
        Time of day, UTC (ISO 8601).

    >>> lab = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=60.0, measured="2026-10-01")
    >>> too_old(lab, 30.0, "2026-11-15T12:00:00+00:00")
    "'lab' was measured 46 days ago (2026-10-01), and the rig takes calibrations of at most 30 days"
    """
    if age_limit is None:
        return ""
    wanted = f"and the rig takes calibrations of at most {age_limit:g} days"
    if not calibration.measured:
        return (
            f"{calibration.name!r} does not say when it was measured, {wanted}: write "
            '`measured = "YYYY-MM-DD"` into its toml file'
        )
    days = (_moment(now) - _moment(calibration.measured)).total_seconds() / SECONDS_A_DAY
    if days < -1:  # within a day it may be another zone's date
        return f"{calibration.name!r} says that it was measured in the future ({calibration.measured[:10]})"
    if days <= age_limit:
        return ""
    return f"{calibration.name!r} was measured {days:.0f} days ago ({calibration.measured[:10]}), {wanted}"


def require_young(calibration: Display | PowerModel, age_limit: float | None, *, accepted: bool) -> str:
    """Return what is wrong with a calibration's age, if that is accepted; refuse it else."""
    problem = too_old(calibration, age_limit, utc_now())
    if problem and not accepted:
        raise InputError(f"{problem}; measure it again, or give --old-calibration-ok")
    return problem


def _moment(text: str) -> datetime:
    """Return a time of day; one without a zone is UTC."""
    moment = datetime.fromisoformat(text)
    return moment if moment.tzinfo else moment.replace(tzinfo=UTC)


def utc_now() -> str:
    """Return the time of day, UTC (ISO 8601)."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")
