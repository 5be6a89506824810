"""What is kept of a walk that a controller dimmed."""

from __future__ import annotations

from pathlib import Path

from data_schema.control import TuningReport
from data_schema.display import Display
from data_schema.live_control import LiveControl, LiveRefresh
from data_schema.provenance import provenance_now, sha256_of_record
from data_schema.rate_limit import RateLimit
from data_schema.text_files import read_json_record, write_json_record, write_rows
from method.choices import LimitCurve
from method.controller import ControllerSettings

LOG, RECORD = "live_control.csv", "live_control.json"


def settings_of(target_loss: float, tuning: Path | None) -> ControllerSettings:
    """Return the controller's settings: the paper's gains, or those of a `tuning.json`."""
    if tuning is None:
        return ControllerSettings(target_loss)
    tuned = read_json_record(TuningReport, tuning)
    return ControllerSettings(
        target_loss,
        proportional=tuned.after.proportional,
        integral=tuned.after.integral,
        derivative=tuned.after.derivative,
        gain_rate=tuned.gain_rate,
    )


def live_control(
    settings: ControllerSettings,
    limit: tuple[RateLimit, LimitCurve],
    seen: tuple[str, Display, str],
    rows: list[LiveRefresh],
    simulated: bool,
) -> LiveControl:
    """Return the record of a walk.

    Parameters
    ----------
    settings : ControllerSettings
        Of the controller.
    limit : (RateLimit, LimitCurve)
        The rate limit, and which of its curves.
    seen : (str, Display, str)
        The scene, the display that showed it, and what measured its loss.
    rows : list of LiveRefresh
        What the controller did.
    simulated : bool
        Whether nobody sat at the keys.
    """
    (rate_limit, curve), (scene, display, measured_by) = limit, seen
    losses = [row.contrast_loss for row in rows if row.contrast_loss is not None]
    inputs = {"display": sha256_of_record(display), "rate_limit": sha256_of_record(rate_limit)}
    return LiveControl(
        scene=scene,
        display=display,
        simulated=simulated,
        target_loss=settings.target_loss,
        proportional=settings.proportional,
        integral=settings.integral,
        derivative=settings.derivative,
        gain_rate=settings.gain_rate,
        lowest_factor=settings.lowest_factor,
        highest_factor=settings.highest_factor,
        rate_limit=rate_limit.name,
        limit_curve=curve.value,
        measured_by=measured_by,
        mean_loss=sum(losses) / len(losses) if losses else None,
        mean_factor=sum(row.factor for row in rows) / len(rows) if rows else None,
        provenance=provenance_now(inputs=inputs),
    )


def write_live(folder: Path, record: LiveControl, rows: list[LiveRefresh]) -> None:
    """Write what is kept of a walk: the record, and a row for each refresh."""
    write_json_record(folder / RECORD, record)
    write_rows(folder / LOG, LiveRefresh, rows)
