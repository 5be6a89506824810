"""The images of clips, decoded ahead or drawn when due."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.frame import rgb_of
from evenlight.experiments.playback.frame_buffer import FrameBuffer, LevelFrame
from evenlight.experiments.playback.screen_geometry import shown_size
from evenlight.experiments.recordings import frames_of_refreshes
from evenlight.experiments.stage import Clip
from evenlight.stimuli.dimmed.track_fit import LARGEST_DEVIATION, wrong_count, wrong_time
from evenlight.stimuli.dithering import GRID_LEVELS, levels_of
from evenlight.stimuli.eyes.eye_views import eye_views
from evenlight.stimuli.image_renderer import EyeImages, Image, ImageUploads
from evenlight.stimuli.image_scaler import ImageScaler
from evenlight.stimuli.scenes.content.catalogue import scene_of
from evenlight.stimuli.scenes.engine.antialiasing import LIVE, Antialiasing
from evenlight.stimuli.scenes.engine.camera_path import check_path
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer
from evenlight.stimuli.scenes.engine.stereo import StereoRenderer
from evenlight.stimuli.scenes.gltf.gltf_differences import tell_differences
from evenlight.stimuli.scenes.scene_sequence import SceneSequence

if TYPE_CHECKING:
    import moderngl

    from evenlight.experiments.showing import Screen
    from evenlight.hardware.protocols import Window

AHEAD = 2.0  # [s] of video that is decoded before it begins


class ImageFeed(AbstractContextManager["ImageFeed"]):
    """Gives the images of a clip, in order.

    Attributes
    ----------
    for_each_refresh : bool
        Whether what a refresh shows is the moment at which it is due, or a frame that lasts.
    """

    for_each_refresh: ClassVar[bool] = False
    _size: tuple[int, int]

    def ready(self, patience: float) -> bool:
        """Wait until the clip can begin, for some time at most [s], and return whether it can.

        What is drawn when it is due can at once.
        """
        return True

    def size(self) -> tuple[int, int]:
        """Return width and height of the images, in a headset of an eye's [pixels]."""
        return self._size

    def image(self, index: int, time: float = 0.0) -> Image | EyeImages:
        """Return the image of a frame; it holds until the next one is asked for.

        Parameters
        ----------
        index : int
            Number of the frame.
        time : float, optional
            When its refresh is due, since the first [s]: what is drawn anew for each shows that moment.

        Raises
        ------
        InputError
            If there is none.
        """
        raise NotImplementedError  # each kind has its own

    def levels(self) -> tuple[NDArray[Any], int]:
        """Return the levels of the image last asked for, (height, width, 3), and how many there are."""
        raise NotImplementedError  # each kind has its own

    def __exit__(self, *_: object) -> None:
        """End the reading, where something is read."""


class VideoFeed(ImageFeed):
    """The images of a video that is decoded ahead, from now on.

    Parameters
    ----------
    clip : Clip
        The clip.
    n_frames : int
        How many of its frames are needed.
    renderer : ImageUploads
        Puts them into the graphics memory.
    scaler : ImageScaler, optional
        Scales them there, as the clip says.

    Raises
    ------
    InputError
        If the video has more or fewer frames than the clip.
    """

    def __init__(
        self, clip: Clip, n_frames: int, renderer: ImageUploads, scaler: ImageScaler | None = None
    ) -> None:
        assert clip.video is not None
        self._scaler, self._scale = scaler, clip.scale or 1.0
        self._clip, self._renderer, self._name = clip, renderer, clip.video.name
        self._n_frames = n_frames
        known, wanted = clip.video.n_frames, len(clip.factors)
        if known is not None and known != wanted:
            raise wrong_count(self._name, known, wanted)
        self._buffer = FrameBuffer(clip.video, n_frames, planes=renderer.takes_planes)
        self._frame: LevelFrame | None = None
        self._image: Image | None = None

    def serves(self, clip: Clip, n_frames: int) -> bool:
        """Return whether these are the images of as many frames of a clip, however it is dimmed."""
        here, length = self._clip, self._n_frames
        same = here.video is clip.video and here.times is clip.times and here.scale == clip.scale
        return same and length == n_frames

    def ready(self, patience: float) -> bool:
        """Wait until the clip can begin, for some time at most [s], and return whether it can."""
        return self._buffer.ready(AHEAD, patience)

    def size(self) -> tuple[int, int]:
        """Return width and height of the images [pixels]; before the first image, of that."""
        height, width, _ = self._present().levels.shape
        room = (width, height) if self._scaler is None else self._scaler.room
        return shown_size((width, height), self._scale, room)

    def image(self, index: int, time: float = 0.0) -> Image:
        """Return the image of a frame; it holds until the next one is asked for."""
        if self._image is None or self._frame is None or index != self._frame.index:
            self._frame = self._taken(index)
            self._image = self._renderer.upload(self._frame.levels, self._frame.count)
            if self._scaler is not None:
                self._image = self._scaler.scaled(self._image, self._scale, self.size())
        return self._image

    def levels(self) -> tuple[NDArray[Any], int]:
        """Return the levels of the image last asked for, (height, width, 3), and how many there are."""
        if self._scaler is not None:
            return self._scaler.levels()
        frame = self._present()
        return rgb_of(frame.levels), frame.count

    def close(self) -> None:
        """End the reading."""
        self._buffer.close()

    def __exit__(self, *_: object) -> None:
        self.close()

    def _present(self) -> LevelFrame:
        if self._frame is None:
            self._frame = self._taken(0)
        return self._frame

    def _taken(self, index: int) -> LevelFrame:
        """Return a frame that appears when its track says."""
        frame, wanted = self._buffer.frame(index), float(self._clip.times[index])
        if abs(frame.time - wanted) > LARGEST_DEVIATION:
            raise wrong_time(self._name, index, frame.time, wanted)
        return frame


def part_of(levels: NDArray[Any], whole: tuple[int, int], part: tuple[int, int]) -> NDArray[Any]:
    """Return what of an image in the middle of a window lies in a part in its middle, as windows read it.

    Parameters
    ----------
    levels : array, (height, width, ...)
        The image.
    whole, part : (int, int)
        Width and height of the window, and of the part; the part is no larger than either.

    >>> part_of(np.arange(12).reshape(3, 4), (9, 8), (3, 1)).tolist()
    [[5, 6, 7]]
    """
    height, width = levels.shape[:2]
    left = (whole[0] - part[0]) // 2 - (whole[0] - width) // 2
    top = (whole[1] - part[1]) // 2 - (whole[1] - height) // 2
    return np.asarray(levels[top : top + part[1], left : left + part[0]])


class ClipFeeds:
    """Opens the images of clips: a file's are decoded ahead, those of a scene are drawn when due.

    Parameters
    ----------
    context : moderngl.Context
        The window's.
    renderer : ImageRenderer
        Puts images into the graphics memory.
    showing : Screen
        What they are shown on.
    """

    def __init__(self, context: moderngl.Context, renderer: ImageUploads, showing: Screen) -> None:
        self._context, self._renderer, self._on = context, renderer, showing
        self._scene: SceneFeed | EyeSceneFeed | None = None  # kept, for it takes long to make
        self._scaler: ImageScaler | None = None
        self._prepared: VideoFeed | None = None

    def prepare(self, clip: Clip) -> None:
        """Begin to read a clip, unless it is being read; another one that was not taken is let go.

        Raises
        ------
        InputError
            If the video has not as many frames as the clip, or there is no such scene.
        """
        clip = self._as_fed(clip)
        if isinstance(clip.video, SceneSequence):
            self.close()
            self._scene_feed(clip.video, clip.scale)
        elif self._prepared is None or not self._prepared.serves(clip, self._n_frames(clip)):
            self.close()
            if clip.scale not in (None, 1.0) and self._scaler is None:
                self._scaler = ImageScaler(self._context, self._on.display.gamma, self._on.window.size())
            scaler = None if clip.scale in (None, 1.0) else self._scaler
            self._prepared = VideoFeed(clip, self._n_frames(clip), self._renderer, scaler)

    def taken(self, clip: Clip) -> ImageFeed:
        """Return the images of a clip, from now on the caller's to close."""
        self.prepare(clip)
        clip = self._as_fed(clip)
        if isinstance(clip.video, SceneSequence):
            return self._scene_feed(clip.video, clip.scale)
        prepared, self._prepared = self._prepared, None
        assert prepared is not None
        return prepared

    def close(self) -> None:
        """End the reading of a clip that was prepared and not taken."""
        if self._prepared is not None:
            self._prepared.close()
            self._prepared = None

    def _n_frames(self, clip: Clip) -> int:
        return int(frames_of_refreshes(clip, self._on.rig.refresh_rate)[-1]) + 1

    def _as_fed(self, clip: Clip) -> Clip:
        """Return a clip as it is fed: in a headset unscaled, for there it lies on something, or is drawn."""
        return replace(clip, scale=None) if self._on.rig.in_headset else clip

    def _scene_feed(self, sequence: SceneSequence, scale: float | None) -> SceneFeed | EyeSceneFeed:
        if self._scene is not None and self._scene.drawn == (sequence, scale):
            return self._scene
        if self._on.rig.in_headset:
            self._scene = EyeSceneFeed(sequence, self._on.window)
        else:
            room = None if scale is None else self._on.window.size()
            self._scene = SceneFeed(sequence, self._context, scale, room)
        return self._scene


class SceneFeed(ImageFeed):
    """Draws the frames of a walk; unscaled and with as many samples, the codes of its `frames`.

    Parameters
    ----------
    sequence : SceneSequence
        The walk.
    context : moderngl.Context
        The window's.
    scale : float, optional
        Pixels of the window per pixel of the sequence: as much detail is drawn.
    room : (int, int), optional
        Width and height of the window, of which the middle is drawn that fits [pixels].
    antialiasing : Antialiasing
        Samples of each pixel.

    Raises
    ------
    InputError
        If there is no such scene, or the path leaves it.
    """

    def __init__(
        self,
        sequence: SceneSequence,
        context: moderngl.Context,
        scale: float | None = None,
        room: tuple[int, int] | None = None,
        antialiasing: Antialiasing = LIVE,
    ) -> None:
        self.drawn, self._path = (sequence, scale), sequence.path()
        scene = scene_of(self._path)
        check_path(self._path, scene)
        tell_differences(scene, self._path, sequence.field_of_view)
        whole, self._scale = (sequence.format.width, sequence.format.height), scale or 1.0
        self._size = shown_size(whole, self._scale, room or whole)
        self._times = [time for time, _ in sequence.format.times()]
        self._renderer = SceneRenderer(context, scene, self._size, sequence.quality, antialiasing)
        self._image = Image(self._renderer.codes, GRID_LEVELS, from_below=True)
        self._index: int | None = None

    def image(self, index: int, time: float = 0.0) -> Image:
        """Return the image of a frame; it holds until the next one is asked for."""
        if index != self._index:
            sequence, _ = self.drawn
            camera = self._path.camera(self._times[index], sequence.field_of_view)
            focal_length = self._scale * camera.focal_pixels(sequence.format.width)
            self._renderer.render(replace(camera, focal_length=focal_length))
            self._renderer.encode()
            self._index = index
        return self._image

    def levels(self) -> tuple[NDArray[Any], int]:
        """Return the levels of the image last asked for, (height, width, 3), and how many there are."""
        levels, count = levels_of(np.asarray(self._renderer.pixel_values()))
        return levels, count


class EyeSceneFeed(ImageFeed):
    """Draws a walk for the views of a headset: position and azimuth of the path, and the head on top.

    Each refresh shows the moment of its own time, between the frames of the sequence too; so the walk is as
    smooth as the headset. The altitude of the path is left to the head.

    Parameters
    ----------
    sequence : SceneSequence
        The walk.
    window : Window
        In a headset, at the origin of which the path's eye is.

    Raises
    ------
    InputError
        If there is no such scene, or the path leaves it.
    """

    for_each_refresh: ClassVar[bool] = True

    def __init__(self, sequence: SceneSequence, window: Window) -> None:
        self.drawn: tuple[SceneSequence, float | None] = (sequence, None)
        self._path, self._window = sequence.path(), window
        scene = scene_of(self._path)
        check_path(self._path, scene)
        tell_differences(scene, self._path, sequence.field_of_view)
        frame = window.eyes()
        assert frame is not None
        sizes = [eye.part[2:] for eye in frame.eyes]
        self._size = sizes[0]
        self._stereo = StereoRenderer(window.context(), scene, sizes, sequence.quality)
        self._images = EyeImages(
            [Image(eye.codes, GRID_LEVELS, from_below=True) for eye in self._stereo.eyes]
        )

    def image(self, index: int, time: float = 0.0) -> EyeImages:
        """Return what the eyes see at a time [s]; it holds until the next is asked for."""
        frame = self._window.eyes()
        assert frame is not None
        camera = self._path.camera(time)
        self._stereo.render(eye_views(frame, camera.position, camera.azimuth))
        self._stereo.encode()
        return self._images

    def levels(self) -> tuple[NDArray[Any], int]:
        """Return the levels that the left eye sees, (height, width, 3), and how many there are."""
        return levels_of(np.asarray(self._stereo.eyes[0].pixel_values()))
