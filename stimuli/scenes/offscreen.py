"""A graphics context without a window."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from evenlight.data_schema.errors import InputError

if TYPE_CHECKING:
    import moderngl


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
