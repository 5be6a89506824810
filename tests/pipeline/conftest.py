"""A laboratory on a virtual screen, for sessions that are seen, killed and resumed."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

import evenlight
from data_schema.dataset_layout import EVENTS, TRIALS
from data_schema.text_files import write_toml_record

ROOT = Path(evenlight.__file__).parent


class Laboratory:
    """A rehearsal of one design, seen on a virtual screen, in processes of its own."""

    def __init__(self, folder: Path, task: str, design: Any, display: str, *options: object) -> None:
        seed = int(os.environ.get("KILL_SEED") or random.randrange(2**32))
        print(f"moments of the kills: KILL_SEED={seed}")  # shown if the test fails; set it to see them again
        self._chance = random.Random(seed)
        self.folder, self._task, self._options = folder, task, options or ("--rig", "simulated")
        self._design = folder / f"{task}.design.toml"
        write_toml_record(self._design, design)
        self._environment = os.environ | {"DISPLAY": display}

    def start(self, name: str, *more: object) -> subprocess.Popen[str]:
        words = ["--participant", "01", "--session", "01", "--simulate", "visual", *self._options]
        words += ["--out", self.folder / name, "--design", self._design, *more]
        return subprocess.Popen(
            [sys.executable, "-m", "evenlight", "run", self._task, *map(str, words)],
            cwd=ROOT,
            env=self._environment,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )

    def run(self, name: str, *more: object, told: str = "") -> str:
        """Run a session to its end; return what it said. On standard error there is `told`, or nothing."""
        process = self.start(name, *more)
        out, err = process.communicate(timeout=200)
        assert process.returncode == 0, err
        assert told in err
        assert bool(told) or err == ""
        return out

    def kill_in_the_midst(self, name: str, *more: object) -> None:
        """Let some trials begin, then end the process with SIGKILL at any moment of the next one."""
        begun = self.count(name)
        process = self.start(name, *more)
        goal, end = begun + self._chance.randint(2, 4), time.monotonic() + 100
        while self.count(name) < goal and process.poll() is None and time.monotonic() < end:
            time.sleep(0.005)
        time.sleep(self._chance.uniform(0.0, 0.15))
        process.send_signal(signal.SIGKILL)
        process.communicate(timeout=60)
        assert process.returncode == -signal.SIGKILL

    def count(self, name: str) -> int:
        """How many trials were begun."""
        path = self.folder / name / "sub-01/ses-01" / EVENTS
        return path.read_text().count('"trial_begun"') if path.exists() else 0

    def rows(self, name: str, file: str = TRIALS) -> list[dict[str, Any]]:
        text = (self.folder / name / "sub-01/ses-01" / file).read_text()
        return [json.loads(line) for line in text.split("\n")[:-1]]


@pytest.fixture(scope="session")
def laboratory() -> type[Laboratory]:
    """Make a laboratory of a folder, a task, a design, a DISPLAY and more options of `run`."""
    return Laboratory
