"""The images of clips; those of the clip that comes next are read before it is asked for."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING

from evenlight.experiments.clip_recording import frames_of_refreshes
from evenlight.experiments.scene_feed import SceneFeed
from evenlight.experiments.stage import Clip
from evenlight.experiments.video_feed import Feed, VideoFeed
from evenlight.stimuli.image_renderer import ImageRenderer
from evenlight.stimuli.scenes.scene_sequence import SceneSequence

if TYPE_CHECKING:
    import moderngl


class ClipFeeds:
    """Opens the images of clips: a file's are decoded ahead, those of a scene are drawn when due.

    Parameters
    ----------
    context : moderngl.Context
        The window's.
    renderer : ImageRenderer
        Puts images into the graphics memory.
    refresh_rate : float
        Of the display [Hz].
    """

    def __init__(self, context: moderngl.Context, renderer: ImageRenderer, refresh_rate: float) -> None:
        self._context, self._renderer, self._refresh_rate = context, renderer, refresh_rate
        self._scene: SceneFeed | None = None  # kept, for it takes long to make
        self._prepared: VideoFeed | None = None

    def prepare(self, clip: Clip) -> None:
        """Begin to read a clip, unless it is being read; another one that was not taken is let go.

        Raises
        ------
        InputError
            If the video has not as many frames as the clip, or there is no such scene.
        """
        if isinstance(clip.video, SceneSequence):
            self.close()
            self._scene_feed(clip.video)
        elif self._prepared is None or not self._prepared.serves(clip, self._n_frames(clip)):
            self.close()
            self._prepared = VideoFeed(clip, self._n_frames(clip), self._renderer)

    def taken(self, clip: Clip) -> AbstractContextManager[Feed]:
        """Return the images of a clip, from now on the caller's to close."""
        self.prepare(clip)
        if isinstance(clip.video, SceneSequence):
            return nullcontext(self._scene_feed(clip.video))
        prepared, self._prepared = self._prepared, None
        assert prepared is not None
        return prepared

    def close(self) -> None:
        """End the reading of a clip that was prepared and not taken."""
        if self._prepared is not None:
            self._prepared.close()
            self._prepared = None

    def _n_frames(self, clip: Clip) -> int:
        """Return how many frames of a clip's video are needed."""
        return int(frames_of_refreshes(clip, self._refresh_rate)[-1]) + 1

    def _scene_feed(self, sequence: SceneSequence) -> SceneFeed:
        """Return what draws a walk."""
        if self._scene is None or self._scene.sequence != sequence:
            self._scene = SceneFeed(sequence, self._context)
        return self._scene
