"""A graphics context without a window, and the graphics state that scenes are drawn in.

Drawing does not depend on what was set before, and leaves everything switched off.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from evenlight.data_schema.errors import InputError

if TYPE_CHECKING:
    import moderngl

NEAREST, LINEAR, LINEAR_MIPMAP_LINEAR = 0x2600, 0x2601, 0x2703
# Switches that moderngl has no names for, and that others may have left on.
SCISSOR_TEST, STENCIL_TEST, DITHER, FRAMEBUFFER_SRGB = 0x0C11, 0x0B90, 0x0BD0, 0x8DB9
SAMPLE_ALPHA_TO_COVERAGE = 0x809E


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
    """Switch off all that changes what is drawn."""
    import moderngl

    context.enable_only(moderngl.NOTHING)
    context.wireframe = False
    context.polygon_offset = 0.0, 0.0
    context.depth_func = "<="
    context.front_face, context.cull_face = "ccw", "back"
    for switch in (SCISSOR_TEST, STENCIL_TEST, DITHER, FRAMEBUFFER_SRGB, SAMPLE_ALPHA_TO_COVERAGE):
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
