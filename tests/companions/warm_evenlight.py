"""Runs of `evenlight` in processes of their own that need not import everything again.

A process that has imported what a session needs waits beside the tests, and each run is a fork of it (the
standard library's fork server). A run has what any process has: an id, an exit code, signals that end it, its
own connection to the screen, and what it wrote when it was killed.
"""

from __future__ import annotations

import contextlib
import faulthandler
import json
import multiprocessing
import os
import runpy
import shutil
import signal
import sys
import tempfile
from pathlib import Path
from typing import Any

FORKS = multiprocessing.get_context("forkserver")
FORKS.set_forkserver_preload(["warm_modules"])
STREAMS = ("out", "err")


class Run:
    """A run that was started; what tests ask it is named as in `subprocess.Popen`.

    Parameters
    ----------
    words : list of str
        Of the command line, after `evenlight`.
    environment : dict
        The environment variables of the run.
    script : Path, optional
        What is run instead of `evenlight`.
    """

    def __init__(self, words: list[str], environment: dict[str, str], script: Path | None = None) -> None:
        self._folder = Path(tempfile.mkdtemp(prefix="evenlight-run-"))
        for name in STREAMS:
            (self._folder / name).touch()
        self._process = FORKS.Process(target=_be_evenlight, args=(words, environment, self._folder, script))
        before = os.environ.get("PYTHONPATH")
        os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, sys.path))  # where the fork server looks
        try:
            self._process.start()
        finally:
            if before is None:
                del os.environ["PYTHONPATH"]
            else:
                os.environ["PYTHONPATH"] = before

    @property
    def returncode(self) -> int | None:
        """Its exit code, below 0 the signal that ended it; None while it runs."""
        return self._process.exitcode

    def poll(self) -> int | None:
        """Return the exit code, or None while it runs."""
        return self._process.exitcode

    def send_signal(self, number: int) -> None:
        """Send it a signal, if it still runs: its id may be another's soon after."""
        if self._process.is_alive() and self._process.pid is not None:
            with contextlib.suppress(ProcessLookupError):  # it ended, and nobody has told yet
                os.kill(self._process.pid, number)

    def communicate(self, timeout: float) -> tuple[str, str]:
        """Wait for its end, and return what it wrote on its two streams."""
        self._process.join(timeout)
        ended = not self._process.is_alive()
        self._process.kill()
        out, err = ((self._folder / name).read_text() for name in STREAMS)
        shutil.rmtree(self._folder)
        assert ended, f"it went on for more than {timeout:g} s, and wrote: {out}{err}"
        return out, err


def said_by(script: Path, words: list[str], environment: dict[str, str]) -> dict[str, Any]:
    """Return what a script prints in its last line, having told nothing on standard error."""
    run = Run(words, environment, script)
    out, err = run.communicate(timeout=280)
    assert (run.returncode, err) == (0, ""), f"it ended with {run.returncode}, and wrote: {err}{out}"
    return dict(json.loads(out.splitlines()[-1]))


def _be_evenlight(words: list[str], environment: dict[str, str], folder: Path, script: Path | None) -> None:
    """Do what `python -m evenlight WORDS`, or a script, does, with an environment and streams of its own."""
    os.environ.clear()
    os.environ.update(environment)
    for number, name in enumerate(STREAMS, start=1):
        os.dup2(os.open(folder / name, os.O_WRONLY), number)
    faulthandler.enable()  # a crash says where it was
    signal.signal(signal.SIGINT, signal.default_int_handler)  # the fork server itself minds no Ctrl-C
    sys.argv = [str(script or "evenlight"), *words]
    if script:
        runpy.run_path(str(script), run_name="__main__")
        return
    from evenlight import command as command_line

    command_line.main(words)
