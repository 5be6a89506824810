"""Imports what a session needs, for processes that are forked from one that has it: `warm_evenlight`."""

import contextlib
import importlib
import os

# PsychoPy takes user site-packages for its own otherwise, as hardware/presentation/psychopy_window.py says.
os.environ["PSYCHOPYNOPACKAGES"] = "1"
# Not its window: the import of pyglet's connects to the screen, which each run is to do for itself.
SESSION = ("evenlight.experiments.run_command", "evenlight.experiments.run_session")
for name in (*SESSION, "psychopy.monitors", "psychopy.data"):
    with contextlib.suppress(ImportError):  # a run says then what is missing
        importlib.import_module(name)
