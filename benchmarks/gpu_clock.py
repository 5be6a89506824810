"""How long the graphics processor works, and how fast its memory is."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from evenlight.method.gpu.context import is_software, renderer_name

if TYPE_CHECKING:
    import moderngl

COPIED = 2**28  # bytes, more than a cache holds
COPIED_BY_SOFTWARE = 2**25


def gpu_seconds(
    context: moderngl.Context, start: Callable[[], object], result: Callable[[], object], repeats: int
) -> NDArray[np.float64]:
    """Return how long the graphics processor works at something, (repeats,) [s]; a first time is not counted.

    By timer queries, which leave out what Python, the driver and the bus take. Software OpenGL has none that
    count compute shaders (Mesa's llvmpipe says 1 ns): there it is the time until all is done.

    Parameters
    ----------
    context : moderngl.Context
        Current.
    start : function
        Gives it the work, without waiting.
    result : function
        Fetches what came out; not timed.
    repeats : int
        How often.
    """
    once = _by_clock if is_software(renderer_name(context)) else _by_query
    seconds = []
    for _ in range(repeats + 1):
        seconds.append(once(context, start))
        result()
    return np.array(seconds[1:])


def _by_query(context: moderngl.Context, start: Callable[[], object]) -> float:
    """Return the graphics processor's own time [s]."""
    query = context.query(time=True)
    with query:
        start()
    return float(query.elapsed) * 1e-9


def _by_clock(context: moderngl.Context, start: Callable[[], object]) -> float:
    """Return the time until all is done [s]."""
    context.finish()
    began = time.perf_counter()
    start()
    context.finish()
    return time.perf_counter() - began


def copy_bandwidth(context: moderngl.Context) -> float:
    """Return how many bytes a second a copy from buffer to buffer reads and writes."""
    size = COPIED_BY_SOFTWARE if is_software(renderer_name(context)) else COPIED
    source, target = context.buffer(bytes(size)), context.buffer(bytes(size))
    seconds = gpu_seconds(context, lambda: context.copy_buffer(target, source, size), lambda: None, 7)
    source.release()
    target.release()
    return float(2 * size / np.median(seconds))
