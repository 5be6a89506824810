"""Reading the ramp sessions of a data set, and whether they could have been shown as they say."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import cast

from evenlight.analysis.session_loading import Session, TaskData, load_task
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.dataset_layout import MANIFEST, TRIALS
from evenlight.data_schema.recordings.ramp import RampDesign, RampTrial
from evenlight.data_schema.recordings.roll_call import RollCall
from evenlight.data_schema.recordings.session import SessionManifest
from evenlight.method.contrast.luminance import dimmed_luminance, displayed_luminance

ROUNDING = 1e-6  # relative, of a luminance that was computed and written
TASK = "ramp"
RampSession = Session[RampTrial]


def ramp_design(manifest: SessionManifest) -> RampDesign:
    """Return the design of a ramp session that has one; its manifest has made sure of its class."""
    return cast(RampDesign, manifest.design)


@dataclass(frozen=True, slots=True, kw_only=True)
class RampData(TaskData[RampTrial]):
    """All ramp sessions of a data set.

    Attributes
    ----------
    display : Display
        The one display of all sessions.
    """

    display: Display


def load_ramp_data(dataset: Path, roll: RollCall | None = None) -> RampData:
    """Return the ramp sessions of a data set, of which the roll-call may have been made already.

    Raises
    ------
    InputError
        As of `load_task`; and if sessions ran on different displays, or a trial is one that design and
        display cannot have shown.
    """
    data = load_task(dataset, TASK, RampTrial, roll)
    display = _one_display(data.sessions, dataset)
    for session in data.sessions:
        _check_levels(session)
    return RampData(
        TASK, data.sessions, data.simulated, data.sha256, data.warnings, roll=data.roll, display=display
    )


def _check_levels(session: RampSession) -> None:
    """Refuse trials that the session's design and display cannot have shown."""
    if session.manifest.design is None:
        return  # imported: luminances as measured, compared with the display at the import
    manifest, design = session.manifest, ramp_design(session.manifest)
    display = cast(Display, manifest.display)
    pixel_values = {"white": design.white_pixel_value, "gray": design.gray_pixel_value}
    for trial in session.trials:
        where = f"{session.folder / TRIALS}: trial {trial.trial_index}"
        if trial.procedure is not design.procedure:
            raise InputError(
                f"{where}: procedure is {trial.procedure.value!r}, but {design.procedure.value!r} in the "
                f"session's {MANIFEST}"
            )
        if trial.factor not in design.factors or trial.screen not in design.screens:
            raise InputError(
                f"{where}: the session's design has no {trial.screen} screen at factor {trial.factor:g}"
            )
        full = displayed_luminance(pixel_values[trial.screen], display)
        emitted = full - display.reflected_luminance
        right = float(dimmed_luminance(emitted, trial.factor, display))
        if abs(trial.initial_luminance - right) > ROUNDING * right:
            raise InputError(
                f"{where}: initial_luminance_cd_m2 is {trial.initial_luminance:g}, but {trial.screen} at "
                f"factor {trial.factor:g} has {right:g} cd/m^2 on the session's display"
            )


def _one_display(sessions: tuple[RampSession, ...], dataset: Path) -> Display:
    """Return the display of all sessions, or refuse a data set of several."""
    first, shown = sessions[0].manifest, _display_of(sessions[0])
    for session in sessions[1:]:
        other, display = session.manifest, _display_of(session)
        if display.fingerprint != shown.fingerprint:
            raise InputError(
                f"{dataset}: session {other.session_id} of participant {other.participant_id} ran on the "
                f"display {display.name!r}, session {first.session_id} of participant "
                f"{first.participant_id} on {shown.name!r} with other photometry; a rate limit holds "
                "for one display: fit them apart"
            )
    return shown


def _display_of(session: RampSession) -> Display:
    """Return the display of a session, or refuse one that is unknown."""
    if session.manifest.display is None:
        raise InputError(
            f"{session.folder / MANIFEST}: display is null; expected that of the ramps, for which alone "
            "their rate limit holds"
        )
    return session.manifest.display
