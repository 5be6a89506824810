"""Shaders of all that is drawn, each in a file."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import moderngl

FOLDER = Path(__file__).parent


def shader(name: str) -> str:
    """Return the source of a shader; a line with `#include "noise.glsl"` stands for that file."""
    source = (FOLDER / f"{name}.glsl").read_text(encoding="utf-8")
    return re.sub(r'#include "(\w+)\.glsl"', lambda included: shader(included[1]), source)


def over_all(context: moderngl.Context, fragment: str) -> moderngl.VertexArray:
    """Return a triangle that covers all of a framebuffer, with the source of a shader."""
    return context.vertex_array(
        context.program(vertex_shader=shader("whole_vertex"), fragment_shader=fragment), []
    )


def set_uniforms(surface: moderngl.VertexArray, /, **values: Any) -> None:
    """Set uniforms of a program, those that it uses; matrices are given for columns."""
    for name, value in values.items():
        if name not in surface.program:
            continue
        uniform: Any = surface.program[name]
        if isinstance(value, np.ndarray) and value.ndim == 2:
            uniform.write(value.T.astype("f4").tobytes())
        else:
            uniform.value = tuple(np.asarray(value).tolist()) if np.ndim(value) else value
