"""Free movement in a scene, seen in a headset: the stick walks and turns, and the head looks around freely.

The stick forward and back walks where the head looks, as fast as it is pushed; a flick to the left or right
turns by `SNAP` at once, about the head, for a turn that flows makes many ill. So do the arrow keys left and
right of the operator, whose other keys walk as on a screen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from evenlight.data_schema.recordings.rig import Eye
from evenlight.experiments.playback.headset_dimming import HeadsetDimmer
from evenlight.experiments.playback.walk import SPEED, Walk, Walker, along, moved
from evenlight.hardware.presentation.headset_views import HeadsetFrame, centre_pixels_per_degree
from evenlight.hardware.presentation.headset_window import HeadsetWindow
from evenlight.hardware.protocols import HeldKeys, KeyPress, Pointer
from evenlight.stimuli.dithering import GRID_LEVELS
from evenlight.stimuli.eyes.eye_views import eye_views, head_direction
from evenlight.stimuli.image_renderer import EyeImages, Image
from evenlight.stimuli.scenes.engine.camera_path import walked
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer
from evenlight.stimuli.scenes.engine.stereo import StereoRenderer

SNAP = 30.0  # [deg]
TURNS = {"stick_left": -SNAP, "stick_right": SNAP, "left": -SNAP, "right": SNAP}
AT_REST = 0.2  # of a stick's way that a hand leaves it at


class HeadsetWalk(Walk):
    """Shows a scene to both eyes of a user who walks in it; the walker is the headset's origin there.

    Parameters are those of `Walk`, of devices with a window in a headset.
    """

    def walk(self, held: HeldKeys, pointer: Pointer | None, seconds: float | None = None) -> None:
        """Walk until the pause key is pressed, or for some time [s]; then the rows are completed."""
        self._window.recentre()
        try:
            super().walk(held, pointer, seconds)
        finally:
            if isinstance(self.dimmer, HeadsetDimmer):
                self.dimmer.finish()

    def _drawn(self) -> tuple[SceneRenderer, Image | EyeImages]:
        window, sizes = self._window, self._window.view_sizes()
        self._eye = int(self._devices.rig.eye is Eye.RIGHT)
        self._stereo = StereoRenderer(window.context(), self._scene, sizes)
        counts = self._stereo.eyes[self._eye]  # all that the eye sees, with the pixels per degree of that
        density = centre_pixels_per_degree(window.facts().fovs[self._eye], sizes[self._eye][0])
        self.display = replace(self.display, pixels_per_degree=density)
        counts.seen, self._hidden = window.seen_pixels(), window.facts().hidden
        return counts, EyeImages(
            [Image(eye.codes, GRID_LEVELS, from_below=True) for eye in self._stereo.eyes]
        )

    @property
    def _window(self) -> HeadsetWindow:
        assert isinstance(self._devices.window, HeadsetWindow)
        return self._devices.window

    def _turned(self, walker: Walker, presses: Sequence[KeyPress]) -> Walker:
        for press in presses:
            walker = turned(walker, TURNS.get(press.name, 0.0), self._window.eyes())
        return walker

    def _moved(
        self, walker: Walker, held: frozenset[str], mouse: tuple[float, float], seconds: float
    ) -> Walker:
        heading = walker.azimuth + head_direction(self._window.eyes().head)[0]
        push = self._window.stick()[1]
        ahead = SPEED * seconds * push if abs(push) > AT_REST else 0.0
        position = walked(walker.position, along(heading, ahead, 0.0), self._scene)
        keys = frozenset(held - TURNS.keys())
        after = moved(Walker(position, heading), keys, (0.0, 0.0), seconds, self._scene)
        return replace(walker, position=after.position)

    def _render(self, walker: Walker) -> Walker:
        frame = self._window.eyes()
        views = eye_views(frame, walker.position, walker.azimuth)
        if (hidden := self._window.facts().hidden) is not self._hidden:
            self.pictures.seen, self._hidden = self._window.seen_pixels(), hidden
        self._stereo.render(views)
        self._stereo.encode()
        if isinstance(self.dimmer, HeadsetDimmer):
            self.dimmer.seen_from(views[self._eye])
        azimuth, altitude = head_direction(frame.head)
        return Walker(views[self._eye].position, (walker.azimuth + azimuth) % 360, altitude)

    def _due(self) -> float:
        return self._window.due(1 / self._devices.rig.refresh_rate)


def turned(walker: Walker, by: float, frame: HeadsetFrame) -> Walker:
    """Return a walker who turned to the right by an angle [deg], with the head where it was.

    Parameters
    ----------
    walker : Walker
        Where the headset's origin is.
    by : float
        The angle.
    frame : HeadsetFrame
        Where the head is.
    """
    aside, _, back = frame.head.position
    azimuth = (walker.azimuth + by) % 360
    before, after = (along(way, -back, aside) for way in (walker.azimuth, azimuth))
    x, y, z = walker.position
    return replace(walker, position=(x + before[0] - after[0], y + before[1] - after[1], z), azimuth=azimuth)
