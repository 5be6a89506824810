"""The largest memory of a process that does one thing."""

from __future__ import annotations

import functools
import subprocess
import sys
from pathlib import Path

# Linux's own figure: `ru_maxrss` of a new process begins at that of the one that started it.
_PROGRAM = """
import importlib
from pathlib import Path
module, function, *arguments = sys.argv[2:]
getattr(importlib.import_module(module), function)(*arguments)
status = Path("/proc/self/status")
if status.exists():
    print(next(line.split()[1] for line in status.read_text().splitlines() if line.startswith("VmHWM")))
"""
_FIND = "import sys; sys.path.insert(0, sys.argv[1])\n"
_CHECKOUT = str(Path(__file__).parents[1])
PATIENCE = 600.0  # [s]


def peak_memory(task: str, *arguments: str) -> float | None:
    """Return the largest memory of a process of its own that does a task, less that of one that does nothing.

    Parameters
    ----------
    task : str
        `module:function`; the function takes the arguments as text.
    *arguments : str
        Its arguments.

    Returns
    -------
    float or None
        [MiB]; None where the system does not tell.
    """
    module, _, function = task.partition(":")
    used, idle = _largest(module, function, *arguments), _largest_idle(module)
    return None if used is None or idle is None else max(used - idle, 0.0)


def idle() -> None:
    """Do nothing."""


@functools.cache
def _largest_idle(module: str) -> float | None:
    """Return the memory of a process that imports the same module, and does nothing with it [MiB]."""
    program = f"import {module}\n{_PROGRAM}"
    return _run(program, __name__, "idle")


def _largest(module: str, function: str, *arguments: str) -> float | None:
    """Return the largest memory of a process that calls a function [MiB]."""
    return _run(_PROGRAM, module, function, *arguments)


def _run(program: str, *arguments: str) -> float | None:
    """Return what a process of its own says was its largest memory [MiB]; None where it cannot tell."""
    answer = subprocess.run(
        [sys.executable, "-c", _FIND + program, _CHECKOUT, *arguments],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=True,
    )
    words = answer.stdout.split()
    return int(words[-1]) / 1024 if words else None
