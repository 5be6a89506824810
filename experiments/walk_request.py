"""What `evenlight play SCENE --walk` is asked for, and what it says afterwards."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from data_schema.errors import InputError
from experiments.play_request import rig_of
from experiments.playback import open_devices
from experiments.walk import Walk, write_path
from hardware.rig import open_held_keys, open_pointer
from hardware.simulated_held_keys import SimulatedHeldKeys
from stimuli.commands import size_in
from stimuli.scenes.scenes import SCENES

DISPLAY, SIZE = "varjo-xr3", (640, 360)  # where nothing else is asked for


@dataclass(frozen=True, slots=True)
class WalkRequest:
    """What is asked for.

    Attributes
    ----------
    scene : str
        Name of the scene.
    rig, display, size : str or None
        As on the command line.
    factor : float
        Brightness factor b.
    record : Path or None
        File for the way.
    seconds : float or None
        When to end [s].
    screenshots : Path or None
        Folder for a picture of the screen.
    simulate : bool
        Whether nobody sits at the keys, and somebody simulated walks straight ahead.
    """

    scene: str
    rig: str | None
    display: str | None
    size: str | None
    factor: float
    record: Path | None
    seconds: float | None
    screenshots: Path | None
    simulate: bool

    def __post_init__(self) -> None:
        if self.scene not in SCENES:
            raise InputError(f"no scene {self.scene!r} to walk in: there are {', '.join(SCENES)}")
        if not 0 < self.factor <= 1:
            raise InputError(f"--factor must be above 0 and at most 1, got {self.factor:g}")
        if self.seconds is not None and not self.seconds > 0:
            raise InputError(f"--seconds must be above 0, got {self.seconds:g}")
        if self.simulate and self.seconds is None:
            raise InputError("--walk ends with escape, which nobody presses with --simulate: give --seconds")
        if self.record is not None and self.record.suffix != ".json":
            raise InputError(f"--record {self.record}: give a file that ends in .json")
        if self.record is not None and not self.record.absolute().parent.is_dir():
            raise InputError(
                f"--record {self.record}: there is no folder {self.record.parent}; make it first"
            )
        if self.rig is not None and self.size is not None:
            raise InputError("--size is of a window without a rig; the rig has a size of its own")


def walk_as_asked(asked: WalkRequest) -> str:
    """Let somebody walk, and return how it went in one line."""
    rig, display = rig_of(asked.rig, asked.display, DISPLAY, size_in(asked.size) or SIZE)
    with ExitStack() as stack:
        opened = open_devices(rig, display, simulated=asked.simulate, any_rate=asked.rig is None)
        devices = stack.enter_context(opened)
        walk = Walk(devices, asked.scene, asked.factor, asked.screenshots)
        window = devices.window
        straight_on = SimulatedHeldKeys(window.now, [("w", 0.0, float("inf"))])
        held = straight_on if asked.simulate else open_held_keys(window)
        if held is None:
            raise InputError("this window does not tell which keys are held down, and nobody can walk in it")
        stack.callback(held.close)
        pointer = None if asked.simulate else open_pointer(window)
        if pointer is not None:
            stack.callback(pointer.close)
        done = walk.walk(held, pointer, asked.seconds)
    seconds = done.flip_times[-1] if done.flip_times else 0.0
    said = (
        f"{asked.scene}: {len(done.flip_times)} refreshes in {seconds:.1f} s, {done.frames_dropped} dropped"
    )
    if asked.record is None or seconds == 0:
        return said
    write_path(asked.record, asked.scene, done.way)
    return f"{said}; the way is in {asked.record}"
