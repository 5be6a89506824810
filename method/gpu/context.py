"""What OpenGL gives: contexts with compute shaders, programs of them, and fences.

A program's text is files of `method/shaders`, with the constants of the method written in. Fences tell
whether the graphics processor has done what it was given, without waiting for it. moderngl has none: OpenGL's
own (3.2 and later) are called. Where they cannot be found, time must do: what was given counts as done when
it is asked for the second time, a refresh later than the first.
"""

from __future__ import annotations

import contextlib
import ctypes
import sys
import threading
import weakref
from collections.abc import Callable
from concurrent.futures import Future
from functools import lru_cache
from importlib import resources
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from evenlight.data_schema.errors import InputError
from evenlight.method.contrast.critical_factor import MASKING_RANGE
from evenlight.method.contrast.csf import LOWEST_LUMINANCE
from evenlight.method.contrast.luminance import LUMINANCE_WEIGHTS
from evenlight.method.contrast.masking import MASKING_EXPONENT
from evenlight.method.contrast.pyramid import INNER_WEIGHT, OUTER_WEIGHT

if TYPE_CHECKING:
    import moderngl

Result = TypeVar("Result")
Call = tuple[Future[Any], Callable[..., Any], tuple[Any, ...]]  # and where its answer goes
VERSION = 430  # of OpenGL, the first with compute shaders
# Renderers that are programs for the processor; zink draws through Vulkan, and names what that runs on.
_SOFTWARE = ("llvmpipe", "softpipe", "swrast", "lavapipe", "swiftshader", "software", "basic render")
_ADVICE = (
    "use the processor (device cpu), or install a graphics driver with OpenGL 4.3 (Mesa's software one "
    "is enough: on Debian, libegl1 and libgl1-mesa-dri)"
)
_COMMANDS_COMPLETE, _FLUSH = 0x9117, 0x1
_SIGNALED = (0x911A, 0x911C)  # already, or while it was asked
_LIBRARIES = ("libOpenGL.so.0", "libGL.so.1")  # each hands on to the thread's context, of EGL or of GLX
_PATIENCE = 2  # times that one is asked without fences
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
        self._calls: SimpleQueue[Call | None] = SimpleQueue()
        threading.Thread(target=_answer, args=(self._calls,), name="graphics", daemon=True).start()
        try:
            self.context = self.run(compute_context)
        except BaseException:
            self._calls.put(None)
            raise
        self.renderer = self.run(renderer_name, self.context)  # asked in another thread, it would be ""
        finalize = weakref.finalize(self, _let_go, self._calls, self.context)
        finalize.atexit = False  # the process takes it along

    def run(self, function: Callable[..., Result], *arguments: Any) -> Result:
        """Return what a function gives in the context's thread."""
        answer: Future[Result] = Future()
        self._calls.put((answer, function, arguments))
        return answer.result()


def _answer(calls: SimpleQueue[Call | None]) -> None:
    """Make the calls of a queue, one after the other, until it says None."""
    while (call := calls.get()) is not None:
        answer, function, arguments = call
        try:
            answer.set_result(function(*arguments))
        except BaseException as error:
            answer.set_exception(error)
        del call, answer, function, arguments  # an idle thread keeps nothing alive


def _let_go(calls: SimpleQueue[Call | None], context: moderngl.Context) -> None:
    """Release a context in its thread, and end the thread.

    The garbage collector may call this anywhere, also where its thread holds a lock: a put into a simple
    queue is safe there, the submission to an executor is not.
    """
    calls.put((Future(), context.release, ()))
    calls.put(None)


class _Calls(NamedTuple):
    """OpenGL's functions."""

    fence: Any
    wait: Any
    delete: Any


class Fence:
    """Behind all that the thread's context has been given so far; of that thread only."""

    def __init__(self) -> None:
        calls = _calls()
        self._asked = 0
        self._sync = None if calls is None else calls.fence(_COMMANDS_COMPLETE, 0)

    def passed(self) -> bool:
        """Return whether all before it is done; never waits."""
        calls = _calls()
        self._asked += 1
        if calls is None or not self._sync:
            return self._asked >= _PATIENCE
        return calls.wait(self._sync, _FLUSH, 0) in _SIGNALED

    def release(self) -> None:
        """Let go of it."""
        calls = _calls()
        if calls is not None and self._sync:
            calls.delete(self._sync)
        self._sync = None


@lru_cache(maxsize=1)
def _calls() -> _Calls | None:
    if sys.platform == "win32":
        return None  # there each context has its own, and moderngl does not tell which
    for name in _LIBRARIES:
        with contextlib.suppress(OSError, AttributeError):
            library = ctypes.CDLL(name)
            fence, wait, delete = library.glFenceSync, library.glClientWaitSync, library.glDeleteSync
            fence.restype, fence.argtypes = ctypes.c_void_p, [ctypes.c_uint, ctypes.c_uint]
            wait.restype, wait.argtypes = ctypes.c_uint, [ctypes.c_void_p, ctypes.c_uint, ctypes.c_uint64]
            delete.restype, delete.argtypes = None, [ctypes.c_void_p]
            return _Calls(fence, wait, delete)
    return None


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
    if not isinstance(context.extra, _Programs):  # another library's: nothing is kept
        return context.compute_shader(text)
    if text not in context.extra:
        context.extra[text] = context.compute_shader(text)
    return context.extra[text]
