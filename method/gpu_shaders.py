"""The compute shaders: their texts, with the constants of the method written in, and programs of them."""

from __future__ import annotations

from importlib import resources
from typing import TYPE_CHECKING

from evenlight.method.critical_factor import MASKING_RANGE
from evenlight.method.csf import LOWEST_LUMINANCE
from evenlight.method.luminance import LUMINANCE_WEIGHTS
from evenlight.method.masking import MASKING_EXPONENT
from evenlight.method.pyramid import INNER_WEIGHT, OUTER_WEIGHT

if TYPE_CHECKING:
    import moderngl

_CONSTANTS: dict[str, object] = {
    "LUMINANCE_WEIGHTS": ", ".join(map(repr, LUMINANCE_WEIGHTS)),
    "INNER_WEIGHT": INNER_WEIGHT,
    "OUTER_WEIGHT": OUTER_WEIGHT,
    "TWICE_INNER": 2 * INNER_WEIGHT,
    "TWICE_OUTER": 2 * OUTER_WEIGHT,
    "MASKING_EXPONENT": MASKING_EXPONENT,
    "DARKEST": LOWEST_LUMINANCE,
    "MASKING_LOW": MASKING_RANGE[0],
    "PER_MASKING_SPAN": 1 / (MASKING_RANGE[1] - MASKING_RANGE[0]),
}


def shader(names: tuple[str, ...], defined: dict[str, object]) -> str:
    """Return a shader's text: its files of `method/shaders` one after the other, under what is defined.

    Parameters
    ----------
    names : tuple of str
        Of the files, without their ending.
    defined : dict of str to object
        Names to define and what they stand for; "" for a name that only has to be there.

    >>> shader(("mirror",), {"SIDE": 3}).splitlines()[:2]
    ['#version 430', '#define SIDE 3']
    """
    folder = resources.files("evenlight.method") / "shaders"
    lines = ["#version 430"]
    lines += [f"#define {name} {value}".rstrip() for name, value in (defined | _CONSTANTS).items()]
    lines += [(folder / f"{name}.glsl").read_text(encoding="utf-8") for name in names]
    return "\n".join(lines)


class _Programs(dict[str, "moderngl.ComputeShader"]):
    """The programs of a context, by their text; kept in the context, and let go with it."""


def program(
    context: moderngl.Context, names: tuple[str, ...], defined: dict[str, object]
) -> moderngl.ComputeShader:
    """Return a program of a context, compiled when it is first asked for.

    Frames of another size, or another display, take the same one: set all of its uniforms before each run.

    Parameters
    ----------
    context : moderngl.Context
        With compute shaders.
    names, defined
        As of `shader`.
    """
    text = shader(names, defined)
    if context.extra is None:  # moderngl's place for what belongs to a context
        context.extra = _Programs()
    if not isinstance(context.extra, _Programs):  # somebody else's: nothing is kept
        return context.compute_shader(text)
    if text not in context.extra:
        context.extra[text] = context.compute_shader(text)
    return context.extra[text]
