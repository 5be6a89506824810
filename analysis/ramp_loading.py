"""Reading the ramp sessions of a data set, and whether they could have been shown as they say."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import cast

from evenlight.analysis.session_loading import Session, TaskData, load_task
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.dataset_layout import MANIFEST, TRIALS
from evenlight.data_schema.recordings.display_calibrations import (
    calibrations_in_words,
    calibrations_of,
    why_apart,
)
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
        The display of all sessions, by its newest calibration.
    earlier_displays : tuple of Display
        Its earlier calibrations, in order of measuring.
    """

    display: Display
    earlier_displays: tuple[Display, ...] = ()

    @property
    def displays(self) -> tuple[Display, ...]:
        """The calibrations of the display, in order of measuring."""
        return (*self.earlier_displays, self.display)

    @property
    def display_fingerprints(self) -> tuple[str, ...]:
        """Identities of the display's calibrations, if it has several."""
        return tuple(display.fingerprint for display in self.displays) if self.earlier_displays else ()


def load_ramp_data(dataset: Path, roll: RollCall | None = None) -> RampData:
    """Return the ramp sessions of a data set, of which the roll-call may have been made already.

    Raises
    ------
    InputError
        As of `load_task`; and if sessions ran on displays that are no calibrations of one, or a trial is
        one that design and display cannot have shown.
    """
    data = load_task(dataset, TASK, RampTrial, roll)
    manifests = [session.manifest for session in data.sessions]
    if why := why_apart(manifests):
        raise InputError(f"{dataset}: {why}")
    for session in data.sessions:
        _check_levels(session)
    *earlier, display = calibrations_of(manifests)
    said = calibrations_in_words(manifests)
    return RampData(
        task=TASK,
        sessions=data.sessions,
        simulated=data.simulated,
        sha256=data.sha256,
        warnings=(*data.warnings, *((said,) if said else ())),
        roll=data.roll,
        display=display,
        earlier_displays=tuple(earlier),
    )


def _check_levels(session: RampSession) -> None:
    """Refuse trials that the session's design and display cannot have shown."""
    manifest = session.manifest
    if manifest.design is None:
        return  # imported: luminances as measured, compared with the display at the import
    design, display = ramp_design(manifest), cast(Display, manifest.display)
    pixel_values = {"white": design.white_pixel_value, "gray": design.gray_pixel_value}
    for trial in session.trials:
        if trial.procedure is not design.procedure:
            used, right = trial.procedure.value, design.procedure.value
            wrong = f"procedure is {used!r}, but {right!r} in the session's {MANIFEST}"
        elif trial.factor not in design.factors or trial.screen not in design.screens:
            wrong = f"the session's design has no {trial.screen} screen at factor {trial.factor:g}"
        else:
            full = displayed_luminance(pixel_values[trial.screen], display)
            luminance = float(dimmed_luminance(full - display.reflected_luminance, trial.factor, display))
            if abs(trial.initial_luminance - luminance) <= ROUNDING * luminance:
                continue
            wrong = (
                f"initial_luminance_cd_m2 is {trial.initial_luminance:g}, but {trial.screen} at factor "
                f"{trial.factor:g} has {luminance:g} cd/m^2 on the session's display"
            )
        raise InputError(f"{session.folder / TRIALS}: trial {trial.trial_index}: {wrong}")
