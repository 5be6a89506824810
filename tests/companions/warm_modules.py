"""Imports what a session needs, for processes that are forked from one that has it: `warm_evenlight`."""

import contextlib
import importlib.abc
import importlib.machinery
import math
import os
import sys
import types

from evenlight import progress

progress.INTERVAL = math.inf  # on a slow machine too a run tells no progress

# What connects to the screen as it is imported would do so once, for all forks together.
os.environ.pop("DISPLAY", None)
# PsychoPy takes user site-packages for its own otherwise, as hardware/presentation/psychopy_window.py says.
os.environ["PSYCHOPYNOPACKAGES"] = "1"
WINDOWS = "psychopy.visual"
SESSION = ("evenlight.experiments.run_command", "evenlight.experiments.run_session")
for name in (*SESSION, "psychopy.monitors", "psychopy.data"):
    with contextlib.suppress(ImportError):  # a run says then what is missing
        importlib.import_module(name)


class FirstWindow(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Imports PsychoPy's windows in a run: they are there, and pyglet connects to the screen only then.

    It does so where pyglet's import does: with a window that is not seen (`shadow_window`).
    """

    def __init__(self) -> None:
        import pyglet

        pyglet.options["shadow_window"] = False
        self._windows = importlib.import_module(WINDOWS)
        pyglet.options["shadow_window"] = True
        del sys.modules[WINDOWS], sys.modules["psychopy"].visual

    def find_spec(
        self, name: str, path: object, target: object = None
    ) -> importlib.machinery.ModuleSpec | None:
        """Return itself for PsychoPy's windows."""
        return importlib.machinery.ModuleSpec(name, self, is_package=True) if name == WINDOWS else None

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> types.ModuleType:
        """Connect to the screen, and return what was imported before."""
        import pyglet

        pyglet.gl._create_shadow_window()
        return self._windows

    def exec_module(self, module: types.ModuleType) -> None:
        """Do nothing: it was executed."""


with contextlib.suppress(ImportError):
    sys.meta_path.insert(0, FirstWindow())
