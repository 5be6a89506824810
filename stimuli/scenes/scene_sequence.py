"""Walks through scenes as built-in sequences.

The horizontal field of view is 90 degrees, about that of one eye in a headset. A sequence lasts as long as
its path. A shorter one is the beginning of the path: the speed of the walk is part of the stimulus, so that
it is never changed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from evenlight.data_schema.frame import Frame
from evenlight.data_schema.provenance import sha256_of_bytes
from evenlight.stimuli.scenes.content.catalogue import is_scene_file, path_named, scene_of
from evenlight.stimuli.scenes.engine.antialiasing import OFFLINE, Antialiasing
from evenlight.stimuli.scenes.engine.array_cache import scenes_sha256
from evenlight.stimuli.scenes.engine.camera_path import CameraPath
from evenlight.stimuli.scenes.engine.scene import SEED, Quality
from evenlight.stimuli.scenes.gltf.gltf_file import sha256_of_gltf
from evenlight.stimuli.sequence_format import BuiltInSequence, SequenceFormat

FRAMES_PER_SECOND = 25.0


@dataclass(frozen=True, slots=True)
class SceneSequence(BuiltInSequence):
    """What is seen on a walk. Pixel values are 10 bits, encoded for a display with gamma 2.2.

    Attributes
    ----------
    format : SequenceFormat
        Size, length and rate; at most as long as the path.
    path_name : str
        The camera path.
    quality : Quality
        Of the scene's light.
    scene : str
        Name or file of the scene, in place of the path's own.
    antialiasing : Antialiasing
        Samples of each pixel.
    strict : bool
        Refuse a scene of which something is not shown as in its file.
    """

    path_name: str
    quality: Quality = Quality.FINE
    scene: str = ""
    antialiasing: Antialiasing = OFFLINE
    strict: bool = False

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

    def path(self) -> CameraPath:
        """Return the camera path."""
        return path_named(self.path_name, self.scene)

    def sha256(self) -> str:
        """Return the SHA-256 of the sequence's definition."""
        path = self.path()
        kind = self.quality.name, self.antialiasing
        definition: tuple[object, ...] = (scenes_sha256(), *kind, SEED, path.text, self.format)
        if is_scene_file(path.scene):
            definition = (*definition, sha256_of_gltf(Path(path.scene)))
        elif self.scene:
            definition = (*definition, self.scene)
        return sha256_of_bytes(f"scene {definition!r}".encode())

    def frames(self) -> Iterator[Frame]:
        """Yield the frames in order.

        Raises
        ------
        InputError
            If the machine has no OpenGL, the path leaves the scene, or it is not what `strict` asks for.
        """
        from evenlight.stimuli.scenes.engine.camera_path import check_path
        from evenlight.stimuli.scenes.engine.graphics import offscreen_context
        from evenlight.stimuli.scenes.engine.renderer import SceneRenderer
        from evenlight.stimuli.scenes.gltf.gltf_differences import require_as_in_file, tell_differences

        path = self.path()
        with offscreen_context() as context:
            scene = scene_of(path)
            check_path(path, scene)
            if self.strict:
                require_as_in_file(scene)
            tell_differences(scene, path, self.field_of_view)
            size = self.format.width, self.format.height
            renderer = SceneRenderer(context, scene, size, self.quality, self.antialiasing)
            for time, duration in self.format.times():
                renderer.render(path.camera(time, self.field_of_view))
                renderer.encode()
                yield Frame(time, duration, renderer.pixel_values())


def standard_format(path_name: str, scene: str = "") -> SequenceFormat:
    """Return the format of a sequence if nothing else is asked for: the whole path, 640 by 360 at 25 Hz."""
    return SequenceFormat(duration=path_named(path_name, scene).duration, frames_per_second=FRAMES_PER_SECOND)
