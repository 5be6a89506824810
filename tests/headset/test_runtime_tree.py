"""The tests of this folder run beside an OpenXR runtime with a simulated headset, where there can be one."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent
ROOT = FOLDER.parents[1]
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


@pytest.mark.real_time
@pytest.mark.timeout(1260)  # the script ends itself before
def test_the_tests_in_a_runtime_pass() -> None:
    ended = run_in_tree("-m", "pytest", "-n", "0", "--color=no", str(FOLDER))
    if ended.returncode == CANNOT:
        pytest.skip(ended.stderr.splitlines()[-1])
    print(ended.stdout, ended.stderr)  # pytest shows it where the test fails
    failed = [line for line in ended.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    assert (ended.returncode, failed) == (0, [])


def test_the_documented_command_names_its_python_from_the_root(tmp_path: Path) -> None:
    """As `make test-headset` has it, until the tree would be built: a relative path leads nowhere in that."""
    recipe = re.search(r"^test-headset:.*\n\t(.*)", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert recipe is not None
    for folder in ("bin", "stubs"):
        (tmp_path / folder).mkdir()
    (tmp_path / "bin/python").symlink_to(sys.executable)
    for name, body in {"id": "echo 0", "unshare": "true", "timeout": 'printf "%s\\n" "$@"'}.items():
        stub = tmp_path / "stubs" / name
        stub.write_text(f"#!/bin/sh\n{body}\n")
        stub.chmod(0o700)
    line = recipe[1].replace("$(BIN)", os.path.relpath(tmp_path / "bin", ROOT))
    assert "runtime-tree.sh ../" in line
    path = os.pathsep.join([str(tmp_path / "stubs"), os.environ["PATH"]])
    variables = {**os.environ, "PATH": path, "EVENLIGHT_NO_TREE": ""}
    words = subprocess.run(
        ["sh", "-c", line], cwd=ROOT, env=variables, capture_output=True, text=True, check=True
    )
    program = (tmp_path / "bin").resolve() / "python"
    asked = words.stdout.splitlines()
    assert asked[asked.index("in-namespace") + 1 :] == [
        str(program),
        "-m",
        "pytest",
        "-n",
        "0",
        "tests/headset",
    ]


def test_where_there_can_be_no_tree_one_line_says_why() -> None:
    ended = run_in_tree("--version", EVENLIGHT_NO_TREE="1")
    assert (ended.returncode, ended.stdout, ended.stderr.count("\n")) == (CANNOT, "", 1)
    assert "EVENLIGHT_NO_TREE is set" in ended.stderr
