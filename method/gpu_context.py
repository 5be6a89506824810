"""Contexts with compute shaders: without a window, and what is asked of one that there is."""

from __future__ import annotations

import contextlib
import weakref
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, TypeVar

from evenlight.data_schema.errors import InputError

if TYPE_CHECKING:
    import moderngl

Result = TypeVar("Result")

VERSION = 430  # of OpenGL, the first with compute shaders
# Renderers that are programs for the processor; zink draws through Vulkan, and names what that runs on.
_SOFTWARE = ("llvmpipe", "softpipe", "swrast", "lavapipe", "swiftshader", "software", "basic render")
_ADVICE = (
    "use the processor (--device cpu), or install a graphics driver with OpenGL 4.3 (Mesa's software one "
    "will do: on Debian, libegl1 and libgl1-mesa-dri)"
)


def compute_context() -> moderngl.Context:
    """Return a context with compute shaders and without a window: EGL where there is one, else the system's.

    Raises
    ------
    InputError
        If the machine has no OpenGL 4.3, or moderngl is not installed.
    """
    try:
        import moderngl
    except ImportError as error:
        raise InputError(f"the graphics processor needs the package moderngl ({error}); {_ADVICE}") from None
    reasons: list[str] = []
    choices: tuple[dict[str, Any], ...] = ({"backend": "egl"}, {})
    for options in choices:
        try:
            context = moderngl.create_context(standalone=True, require=VERSION, **options)
            return _with_compute(context)
        except Exception as error:  # moderngl raises a bare Exception
            reasons.append(str(error).splitlines()[0] if str(error) else type(error).__name__)
    raise InputError(f"no graphics processor with compute shaders, OpenGL 4.3 ({reasons[0]}); {_ADVICE}")


def _with_compute(context: moderngl.Context) -> moderngl.Context:
    """Return a context that has compute shaders; release one that has none, and raise `InputError`."""
    try:
        require_compute(context)
    except BaseException:
        context.release()
        raise
    return context


def require_compute(context: moderngl.Context) -> None:
    """Raise `InputError` if a context has no compute shaders."""
    if context.version_code < VERSION:
        major, minor = divmod(context.version_code // 10, 10)
        raise InputError(
            f"{renderer_name(context)} offers OpenGL {major}.{minor}, and compute shaders need 4.3; {_ADVICE}"
        )


def renderer_name(context: moderngl.Context) -> str:
    """Return what a context draws and computes with, in its own words."""
    return str(context.info["GL_RENDERER"])


def is_software(renderer: str) -> bool:
    """Return whether a renderer of this name runs on the processor, so that its speed says nothing of a GPU.

    >>> is_software("llvmpipe (LLVM 15.0.6, 256 bits)"), is_software("NVIDIA GeForce RTX 2080/PCIe/SSE2")
    (True, False)
    """
    return any(word in renderer.lower() for word in _SOFTWARE)


class OwnContext:
    """A context without a window in a thread of its own.

    OpenGL has one current context for each thread, and moderngl does not bring back the one before. So that
    scenes can be drawn beside it, and frames can come from any thread, all that needs this context is done in
    a thread where it is the only one, one call after the other.

    Attributes
    ----------
    context : moderngl.Context
        For functions that are given to `run`.
    renderer : str
        What it draws and computes with, in its own words.

    Raises
    ------
    InputError
        If there are no compute shaders.
    """

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="graphics")
        self.context = self.run(compute_context)
        self.renderer = self.run(renderer_name, self.context)  # asked in another thread, it would be ""
        finalize = weakref.finalize(self, _let_go, self._thread, self.context)
        finalize.atexit = False  # the process takes it along

    def run(self, function: Callable[..., Result], *arguments: Any) -> Result:
        """Return what a function gives in the context's thread."""
        return self._thread.submit(function, *arguments).result()


def _let_go(thread: ThreadPoolExecutor, context: moderngl.Context) -> None:
    """Release a context in its thread, and end the thread."""
    with contextlib.suppress(RuntimeError):  # at the end of the process threads take no more work
        thread.submit(context.release)
    thread.shutdown(wait=False)
