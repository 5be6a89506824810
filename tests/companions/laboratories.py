"""A laboratory in which a session is rehearsed in processes of its own: seen, killed and resumed."""

import json
import math
import os
import random
import signal
import time
from pathlib import Path
from typing import Any

from warm_evenlight import Run

from evenlight.data_schema.recordings.dataset_layout import EVENTS, TRIALS
from evenlight.data_schema.storage.text_files import write_toml_record


class Laboratory:
    """A rehearsal of one design, seen on a virtual screen, in processes of its own."""

    def __init__(self, folder: Path, task: str, design: Any, display: str, *options: object) -> None:
        seed = int(os.environ.get("KILL_SEED") or random.randrange(2**32))
        print(f"moments of the kills: KILL_SEED={seed}")  # shown if the test fails; set it to see them again
        self._chance = random.Random(seed)
        self.folder, self._task, self._options = folder, task, options
        self._design = folder / f"{task}.design.toml"
        write_toml_record(self._design, design)
        self._environment = os.environ | {"DISPLAY": display}

    def start(self, name: str, *more: object) -> Any:
        words = ["--participant", "01", "--session", "01", "--simulate", "visual", *self._options]
        words += ["--out", self.folder / name, "--design", self._design, *more]
        return self._process(["run", self._task, *map(str, words)], self._environment)

    def _process(self, words: list[str], environment: dict[str, str]) -> Any:
        return Run(words, environment)

    def run(self, name: str, *more: object, told: str = "") -> str:
        """Run a session to its end; return what it said. On standard error there is `told`, or nothing."""
        process = self.start(name, *more)
        out, err = process.communicate(timeout=200)
        assert process.returncode == 0, err
        assert told in err
        assert bool(told) or err == ""
        return out

    def kill_in_the_midst(self, name: str, *more: object) -> None:
        """Let some trials begin, then end the process with SIGKILL at any moment of the last of them.

        The session has at least four: one more begins, which may be shorter than those before.
        """
        begun = self.count(name)
        process = self.start(name, *more)
        goal, end = begun + self._chance.randint(2, 3), time.monotonic() + 200
        first = math.inf  # when the first trial began
        while (count := self.count(name)) < goal and process.poll() is None and time.monotonic() < end:
            first = min(first, time.monotonic()) if count > begun else first
            time.sleep(0.005)
        a_trial = max(0.0, time.monotonic() - first) / (goal - begun - 1)  # as long as one takes here
        until = time.monotonic() + self._chance.uniform(0.0, a_trial)
        while self.count(name) == goal and time.monotonic() < until:
            time.sleep(0.005)
        process.send_signal(signal.SIGKILL)
        process.communicate(timeout=200)
        assert process.returncode == -signal.SIGKILL

    def count(self, name: str) -> int:
        """How many trials were begun."""
        path = self.folder / name / "sub-01/ses-01" / EVENTS
        return path.read_text().count('"trial_begun"') if path.exists() else 0

    def rows(self, name: str, file: str = TRIALS) -> list[dict[str, Any]]:
        text = (self.folder / name / "sub-01/ses-01" / file).read_text()
        return [json.loads(line) for line in text.split("\n")[:-1]]
