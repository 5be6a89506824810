"""A backlight of so many steps, in memory or behind a program, which tests set as its user does."""

from evenlight.hardware.backlights import SteppedBacklight

# A program for `exec:`, whose step stands in a file beside it.
PROGRAM = """import json, sys
from pathlib import Path
file = Path(sys.argv[0]).with_suffix(".step")
for line in sys.stdin:
    asked = json.loads(line)
    if "factor" in asked:
        file.write_text(str(round(1000 * asked["factor"])))
    own = {"factor": int(file.read_text()) / 1000, "smallest_factor": 0.001, "step": 0.001}
    print(json.dumps({"id": asked["id"], **own}), flush=True)
"""


class SteppedPanel(SteppedBacklight):
    """At full brightness to begin with."""

    _name, _min_interval = "panel", 0.02

    def __init__(self, steps: int = 1000) -> None:
        self._steps = self._found = self._at = steps

    def _set(self, step: int) -> None:
        self._at = step

    def _read_step(self) -> int:
        return self._at
