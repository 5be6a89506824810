"""The task of ramp sessions in tests."""

from evenlight.data_schema.display import Display
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.ramp import RampDesign
from evenlight.data_schema.recordings.rig import Rig
from evenlight.data_schema.recordings.session import SessionManifest, SessionStatus
from evenlight.experiments.ramp.ramp_task import RampTask
from evenlight.experiments.sessions.task import SessionSetting


def ramp_task(design: RampDesign, display: Display, rig: Rig, *, simulated: bool = True) -> RampTask:
    """Return the task of participant 01 with seed 1; one of a person refuses a display that drops frames."""
    manifest = SessionManifest(
        "01", "01", "ramp", simulated, SessionStatus.RUNNING, 0, display, design, Provenance(seed=1)
    )
    return RampTask(SessionSetting(manifest, rig))
