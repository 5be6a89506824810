"""A simulated trigger output."""

from __future__ import annotations

from evenlight.hardware.protocols import ContextDevice


class SimulatedTrigger(ContextDevice):
    """Takes every trigger, and sends none: a session notes them all the same."""

    _name = "the simulated trigger output"

    def send(self, code: int, label: str) -> None:
        """Take a trigger."""
        self._require_open()

    def apparatus(self) -> dict[str, str]:
        """Return that it is simulated."""
        return {"sends": "SIMULATED: nothing"}
