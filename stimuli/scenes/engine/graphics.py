"""What drawing scenes shares: a context without a window, the graphics state, the shaders, the tone curve.

Drawing does not depend on what was set before, and leaves everything switched off.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.shaders import shader

if TYPE_CHECKING:
    import moderngl

NEAREST, LINEAR, LINEAR_MIPMAP_NEAREST, LINEAR_MIPMAP_LINEAR = 0x2600, 0x2601, 0x2701, 0x2703
# Switches that moderngl has no names for, and that others may have left on.
SCISSOR_TEST, STENCIL_TEST, DITHER, FRAMEBUFFER_SRGB = 0x0C11, 0x0B90, 0x0BD0, 0x8DB9
SAMPLE_ALPHA_TO_COVERAGE = 0x809E
CLIP_DISTANCES = (0x3000, 0x3001, 0x3002, 0x3003)
PEAK = 100.0  # [cd/m^2] of the display that scenes are made for, about that of a headset
KNEE = 0.75  # share of the peak above which light is compressed


@contextmanager
def own(context: moderngl.Context) -> Iterator[None]:
    """Draw with everything switched off; afterwards switch off what was used, and bind what was bound."""
    before = context.fbo
    _all_off(context)
    try:
        yield
    finally:
        _all_off(context)
        if before is not None:
            before.use()


def _all_off(context: moderngl.Context) -> None:
    import moderngl

    context.enable_only(moderngl.NOTHING)
    context.wireframe = False
    context.polygon_offset = 0.0, 0.0
    context.depth_func = "<="
    context.front_face, context.cull_face = "ccw", "back"
    switches = SCISSOR_TEST, STENCIL_TEST, DITHER, FRAMEBUFFER_SRGB, SAMPLE_ALPHA_TO_COVERAGE
    for switch in (*switches, *CLIP_DISTANCES):
        context.disable_direct(switch)


def offscreen_context() -> moderngl.Context:
    """Return a graphics context without a window: EGL where there is one, else the system's own.

    Raises
    ------
    InputError
        If the machine has no OpenGL 3.3.
    """
    import moderngl

    reasons: list[str] = []
    choices: tuple[dict[str, Any], ...] = ({"backend": "egl"}, {})
    for options in choices:
        try:
            return moderngl.create_context(standalone=True, require=330, **options)
        except Exception as error:  # moderngl raises a bare Exception
            reasons.append(str(error).splitlines()[0] if str(error) else type(error).__name__)
    raise InputError(
        f"scenes need OpenGL 3.3, and there is none without a window ({reasons[0]}): install a graphics "
        "driver, or Mesa's software one (on Debian, libegl1 and libgl1-mesa-dri)"
    )


def with_defined(source: str, word: str) -> str:
    """Return a shader with a word defined."""
    return source.replace("#version 330\n", f"#version 330\n#define {word}\n")


def with_holes(source: str, samples: int = 1) -> str:
    """Return a shader for materials with holes, into samples that the graphics card takes of each pixel."""
    several = f"#extension GL_ARB_sample_shading : require\n#define SAMPLES {samples}\n" * (samples > 1)
    return source.replace("#version 330\n", f"#version 330\n{several}#define CUTOUT\n{shader('cut')}")
