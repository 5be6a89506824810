"""The machine that a benchmark ran on, in words."""

from __future__ import annotations

import os
import platform
from pathlib import Path

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.scenes.engine.graphics import offscreen_context


def machine() -> dict[str, str]:
    """Return what speed depends on: processor, cores, memory, system, Python, graphics."""
    return {
        "processor": processor_name(),
        "cores": str(_cores()),
        "memory": _memory(),
        "system": f"{platform.system()} {platform.release().partition('-')[0]}",
        "python": platform.python_version(),
        "graphics": _graphics(),
    }


def processor_name() -> str:
    """Return the processor's name."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def _cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _memory() -> str:
    """Return how much memory there is."""
    try:
        size = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return "unknown"
    return f"{size / 2**30:.0f} GiB"


def _graphics() -> str:
    """Return what draws and computes with OpenGL, or why nothing does."""
    try:
        context = offscreen_context()
    except InputError as error:
        return f"none ({error})"
    name = str(context.info["GL_RENDERER"])
    context.release()
    return name
