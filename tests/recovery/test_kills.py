"""Killed at any rename, fsync or half write, a command leaves all of the earlier or all of the new.

The same command again gives then what it would have given undisturbed, and nothing is left over.
"""

import subprocess
import sys
from pathlib import Path

import pytest
from kill_points import CASES

SCRIPT = Path(__file__).parents[1] / "companions" / "kill_points.py"


def killed(folder: Path, *cases: str) -> str:
    """What the script says of the cases, whose process is killed again and again."""
    done = subprocess.run(
        [sys.executable, "-P", SCRIPT, folder, *cases], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.slow
def test_a_track_data_and_a_session_killed_at_their_last_rename(tmp_path: Path) -> None:
    """By it a result appears, or a session is marked as complete."""
    told = killed(tmp_path, "last:optimize", "last:import", "last:run-ramp")
    assert told.count(": 1 kills") == 3


@pytest.mark.every_kill
@pytest.mark.parametrize("name", CASES)
def test_a_command_killed_at_every_step(name: str, tmp_path: Path) -> None:
    print(killed(tmp_path, name))  # pytest shows it with -s or -rP
