"""The manifest of a session, written before its first trial."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from data_schema.display import Display
from data_schema.provenance import Provenance
from data_schema.quantities import check_limits, described, quantity
from data_schema.ramp import RampDesign


class SessionStatus(enum.Enum):
    """How far a session got."""

    RUNNING = "running"
    COMPLETE = "complete"
    ABORTED = "aborted"


@dataclass(frozen=True, slots=True)
class SessionManifest:
    """What a session is: who, which task and design, on which display.

    Attributes
    ----------
    participant_id, session_id, task : str
        Who, which visit, which experiment ("ramp").
    simulated : bool
        Whether a simulated observer answers.
    status : SessionStatus
        How far it got.
    n_trials : int
        Trials that the design asks for.
    display : Display
        The display it ran on.
    design : RampDesign
        What was shown.
    provenance : Provenance
        Software and seed.
    """

    participant_id: str = described("participant", pattern="^[0-9A-Za-z]+$")
    session_id: str = described("session", pattern="^[0-9A-Za-z]+$")
    task: str = described("experiment")
    simulated: bool = described("true if a simulated observer answers")
    status: SessionStatus = described("how far the session got")
    n_trials: int = quantity("1", "trials that the design asks for", minimum=0)
    display: Display = described("display it ran on")
    design: RampDesign = described("what was shown")
    provenance: Provenance = described("how the file was made")

    def __post_init__(self) -> None:
        check_limits(self)
