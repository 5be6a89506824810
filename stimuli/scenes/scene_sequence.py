"""Walks through scenes as built-in sequences.

The horizontal field of view is 90 degrees, about that of one eye in a headset. A sequence lasts as long as
its path. A shorter one is the beginning of the path: the speed of the walk is part of the stimulus, so that
it is never changed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from evenlight.data_schema.frame import Frame
from evenlight.data_schema.provenance import sha256_of_bytes
from evenlight.stimuli.scenes.array_cache import scenes_sha256
from evenlight.stimuli.scenes.camera_path import CameraPath, path_named
from evenlight.stimuli.scenes.scene import SEED, Quality
from evenlight.stimuli.sequence_format import SequenceFormat

FRAMES_PER_SECOND = 25.0


@dataclass(frozen=True, slots=True)
class SceneSequence:
    """What is seen on a walk. Pixel values are 10 bits, encoded for a display with gamma 2.2.

    Attributes
    ----------
    format : SequenceFormat
        Size, length and rate; at most as long as the path.
    path_name : str
        The camera path.
    quality : Quality
        Of the scene's light.
    """

    format: SequenceFormat
    path_name: str
    quality: Quality = Quality.FINE

    def __post_init__(self) -> None:
        path = self.path()
        last = (self.n_frames - 1) / self.format.rate
        if last > path.duration:
            raise ValueError(
                f"need {path.duration:g} s at most, which is how long the path takes, got "
                f"{self.format.duration:g} s"
            )

    @property
    def name(self) -> str:
        """Short name for titles."""
        return self.path().name

    @property
    def n_frames(self) -> int:
        """How many frames there are."""
        return self.format.n_frames

    def path(self) -> CameraPath:
        """Return the camera path."""
        return path_named(self.path_name)

    def sha256(self) -> str:
        """Return the SHA-256 of the sequence's definition."""
        definition = (scenes_sha256(), self.quality.name, SEED, self.path().text, self.format)
        return sha256_of_bytes(f"scene {definition!r}".encode())

    def frames(self) -> Iterator[Frame]:
        """Yield the frames in order.

        Raises
        ------
        InputError
            If the machine has no OpenGL, or the path leaves the scene.
        """
        from evenlight.stimuli.scenes.camera_path import check_path
        from evenlight.stimuli.scenes.graphics import offscreen_context
        from evenlight.stimuli.scenes.renderer import SceneRenderer
        from evenlight.stimuli.scenes.scene import scene_named

        path = self.path()
        with offscreen_context() as context:
            scene = scene_named(path.scene)
            check_path(path, scene)
            renderer = SceneRenderer(context, scene, (self.format.width, self.format.height), self.quality)
            for time, duration in self.format.times():
                renderer.render(path.camera(time))
                renderer.encode()
                yield Frame(time, duration, renderer.pixel_values())


def standard_format(path_name: str) -> SequenceFormat:
    """Return the format of a sequence if nothing else is asked for: the whole path, 640 by 360 at 25 Hz."""
    return SequenceFormat(duration=path_named(path_name).duration, frames_per_second=FRAMES_PER_SECOND)
