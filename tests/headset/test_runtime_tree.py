"""The tests of this folder run beside an OpenXR runtime with a simulated headset, where there can be one."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent
SCRIPT = FOLDER / "runtime-tree.sh"
CANNOT = 77  # with which the script ends where there can be no tree


def run_in_tree(*words: str, **variables: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [SCRIPT, sys.executable, *words],
        env=os.environ | variables,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.slow
@pytest.mark.timeout(1260)  # the script ends itself before
def test_the_tests_in_a_runtime_pass() -> None:
    ended = run_in_tree("-m", "pytest", "-n", "0", "--color=no", str(FOLDER))
    if ended.returncode == CANNOT:
        pytest.skip(ended.stderr.splitlines()[-1])
    print(ended.stdout, ended.stderr)  # pytest shows it where the test fails
    failed = [line for line in ended.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    assert (ended.returncode, failed) == (0, [])


def test_where_there_can_be_no_tree_one_line_says_why() -> None:
    ended = run_in_tree("--version", EVENLIGHT_NO_TREE="1")
    assert (ended.returncode, ended.stdout, ended.stderr.count("\n")) == (CANNOT, "", 1)
    assert "EVENLIGHT_NO_TREE is set" in ended.stderr
