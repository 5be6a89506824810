"""The images of a walk through a scene, drawn in the window's own context as they are due."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from evenlight.stimuli.image_codes import GRID_LEVELS, levels_of
from evenlight.stimuli.image_renderer import Image
from evenlight.stimuli.scenes.renderer import SceneRenderer
from evenlight.stimuli.scenes.scene_sequence import SceneSequence
from evenlight.stimuli.scenes.scenes import scene_named
from evenlight.stimuli.scenes.walking import check_path

if TYPE_CHECKING:
    import moderngl


class SceneFeed:
    """Draws the frames of a walk; the same codes as `SceneSequence.frames` yields.

    Parameters
    ----------
    sequence : SceneSequence
        The walk.
    context : moderngl.Context
        The window's.

    Raises
    ------
    InputError
        If there is no such scene, or the path leaves it.
    """

    def __init__(self, sequence: SceneSequence, context: moderngl.Context) -> None:
        self.sequence, self._path = sequence, sequence.path()
        scene = scene_named(self._path.scene)
        check_path(self._path, scene)
        self._size = sequence.format.width, sequence.format.height
        self._times = [time for time, _ in sequence.format.times()]
        self._renderer = SceneRenderer(context, scene, self._size, sequence.quality)
        self._image = Image(self._renderer.codes, GRID_LEVELS, from_below=True)
        self._drawn: int | None = None

    def ready(self, patience: float) -> bool:
        """Return True: each frame is drawn when it is due."""
        return True

    def size(self) -> tuple[int, int]:
        """Return width and height of the images [pixels]."""
        return self._size

    def image(self, index: int) -> Image:
        """Return the image of a frame; it holds until the next one is asked for."""
        if index != self._drawn:
            self._renderer.render(self._path.camera(self._times[index]))
            self._renderer.encode()
            self._drawn = index
        return self._image

    def levels(self) -> tuple[NDArray[Any], int]:
        """Return the levels of the image last asked for, (height, width, 3), and how many there are."""
        levels, count = levels_of(np.asarray(self._renderer.pixel_values()))
        return levels, count
