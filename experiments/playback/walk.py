"""Free movement in a scene, at a constant brightness factor or a controlled one, until the user ends it."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from evenlight.data_schema.storage.whole_files import write_whole
from evenlight.experiments.playback.live_dimming import LiveDimmer
from evenlight.experiments.playback.player import (
    NOISE_SEED,
    PlaybackDevices,
    ends,
    heads_of,
    pressed_on,
)
from evenlight.experiments.recordings import ClipRecording
from evenlight.experiments.showing import Brightness, Screenshots
from evenlight.hardware.presentation.headset_window import ShownFrame
from evenlight.hardware.protocols import HeldKeys, KeyPress, Pointer
from evenlight.stimuli.dithering import GRID_LEVELS
from evenlight.stimuli.image_renderer import DimmedImage, EyeImages, Image
from evenlight.stimuli.renderers import image_renderer
from evenlight.stimuli.scenes.content.catalogue import PATHS, is_scene_file, path_named, scene_to_walk
from evenlight.stimuli.scenes.engine.antialiasing import LIVE
from evenlight.stimuli.scenes.engine.camera import EYE_HEIGHT, Camera, focal_length_of
from evenlight.stimuli.scenes.engine.camera_path import CameraPath, floor_under, on_ground, walked
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer
from evenlight.stimuli.scenes.engine.scene import Scene, Vector
from evenlight.stimuli.video.viewing_geometry import pixels_per_degree_in

SPEED = 1.4  # [m/s] of a walk (Bohannon 1997: comfortable gait of adults)
HURRY = 2.0  # times as fast with the shift key
TURNING = 90.0  # [deg/s] by the keys
PER_PIXEL = 0.1  # [deg] that a pixel of the mouse turns
HIGHEST = 80.0  # [deg] that one looks up or down
LONGEST_STEP = 0.25  # [s] that a slow machine moves at once
RECORDED_EVERY = 0.5  # [s]
FORWARD = {"w": 1, "up": 1, "s": -1, "down": -1}
SIDEWAYS = {"d": 1, "a": -1}
AROUND = {"right": 1, "left": -1}


@dataclass(frozen=True, slots=True)
class Walker:
    """Where the eye of a walker is [m], and where it looks: clockwise from north, and up [degrees]."""

    position: Vector
    azimuth: float
    altitude: float = 0.0


def moved(
    walker: Walker, held: frozenset[str], mouse: tuple[float, float], seconds: float, scene: Scene
) -> Walker:
    """Return a walker after a short time.

    Parameters
    ----------
    walker : Walker
        Before.
    held : set of str
        Keys that are down: W, A, S, D and the arrows; shift hurries.
    mouse : (float, float)
        How far the mouse moved, to the right and up [pixels].
    seconds : float
        The time [s].
    scene : Scene
        Where.
    """

    def pressed(keys: dict[str, int]) -> int:
        return sum(way for key, way in keys.items() if key in held)

    turned = pressed(AROUND) * TURNING * seconds + mouse[0] * PER_PIXEL
    azimuth = (walker.azimuth + turned) % 360
    altitude = min(max(walker.altitude + mouse[1] * PER_PIXEL, -HIGHEST), HIGHEST)
    ahead, aside = pressed(FORWARD), pressed(SIDEWAYS)
    length = math.hypot(ahead, aside)
    if length == 0:
        return Walker(walker.position, azimuth, altitude)
    metres = SPEED * (HURRY if held & {"lshift", "rshift"} else 1.0) * seconds / length
    step = along(azimuth, metres * ahead, metres * aside)
    return Walker(walked(walker.position, step, scene), azimuth, altitude)


def along(azimuth: float, ahead: float, aside: float) -> tuple[float, float]:
    """Return how far east and north it is some way ahead and to the right [m] of someone who looks so [deg].

    >>> tuple(round(way, 9) for way in along(90.0, ahead=2.0, aside=1.0))
    (2.0, -1.0)
    """
    sine, cosine = math.sin(math.radians(azimuth)), math.cos(math.radians(azimuth))
    return ahead * sine + aside * cosine, ahead * cosine - aside * sine


def start_in(scene: Scene, path: CameraPath | None = None) -> Walker:
    """Return where a walk begins: on a path or that of the scene's name, else amid its first ground."""
    if path is None and (PATHS / f"{scene.name}.json").is_file():
        path = path_named(scene.name)
    on_it = [point for point in path.keypoints if on_ground(point.position, scene)] if path else []
    if on_it:
        (x, y, z), azimuth = on_it[0].position, on_it[0].azimuth
    else:
        (x, y, floor), azimuth = scene.walkable[0].middle, 0.0
        z = floor + EYE_HEIGHT
    under = floor_under((x, y, z), scene)
    return Walker((x, y, z if under is None else under + EYE_HEIGHT), azimuth)


class Walk:
    """Shows a scene to a user who walks in it.

    Parameters
    ----------
    devices : PlaybackDevices
        What on; the picture fills the window.
    scene : str
        Name of the scene, or file of a scene or of a path.
    factor : float
        Brightness factor b, in (0, 1].
    screenshots : Path, optional
        Folder for a picture of the screen.
    field_of_view : float, optional
        Horizontal angle that the window is to span [deg]; without, what it spans at true size.

    Attributes
    ----------
    display : Display
        The rig's, at the pixels per degree that are drawn.
    recording, heads : ClipRecording, list of ShownFrame
        What each refresh showed; in a headset, what its runtime says of each.
    way : list of (float, Walker)
        Where the walker was, since the first refresh [s].
    path : CameraPath or None
        Through a scene of a file.
    pictures : SceneRenderer
        Draws what is shown.
    dimmer : LiveDimmer or None
        Chooses the factor of each picture, in place of the constant one, once it is set.
    """

    def __init__(
        self,
        devices: PlaybackDevices,
        scene: str,
        factor: float,
        screenshots: Path | None = None,
        field_of_view: float | None = None,
    ) -> None:
        window, rig, display = devices.window, devices.rig, devices.display
        if field_of_view is not None:
            display = replace(
                display, pixels_per_degree=pixels_per_degree_in(field_of_view, window.size()[0])
            )
        self.display = display
        self._devices, self._factor = devices, factor
        self._scene, self.path = scene_to_walk(scene)
        self._brightness = Brightness(display, rig.actuator, devices.backlight, window.now)
        self.dimmer: LiveDimmer | None = None
        self.pictures, self._image = self._drawn()
        self._renderer = image_renderer(window, display, rig.dither)
        self._black = display.black_level + display.reflected_luminance
        self._screenshots = Screenshots(screenshots)
        self.recording, self.way = ClipRecording(rig.refresh_rate), list[tuple[float, Walker]]()
        self.heads: list[ShownFrame] = []

    def walk(self, held: HeldKeys, pointer: Pointer | None, seconds: float | None = None) -> None:
        """Walk until the pause key is pressed, or for some time [s]."""
        walker, refreshes = start_in(self._scene, self.path), self.recording.refreshes
        last, onset, presses = None, None, pressed_on(self._devices)
        while not any(ends(press, self._devices.rig) for press in presses):
            walker = self._turned(walker, presses)
            flip = self._show(walker, len(refreshes), onset)
            onset = flip if onset is None else onset
            if self.dimmer is not None:
                self.dimmer.note(flip - onset)
            self.way.append((flip - onset, self._seen))
            if seconds is not None and flip - onset >= seconds:
                break
            step = 0.0 if last is None else min(flip - last, LONGEST_STEP)
            mouse = (0.0, 0.0) if pointer is None else pointer.moved()
            walker, last = self._moved(walker, held.held(), mouse, step), flip
            presses = pressed_on(self._devices)

    def _drawn(self) -> tuple[SceneRenderer, Image | EyeImages]:
        """Return what draws the pictures that count, and the image that is shown."""
        window = self._devices.window
        pictures = SceneRenderer(window.context(), self._scene, window.size(), antialiasing=LIVE)
        return pictures, Image(pictures.codes, GRID_LEVELS, from_below=True)

    def _turned(self, walker: Walker, presses: Sequence[KeyPress]) -> Walker:
        """Return a walker after some keys were pressed: on a screen only held ones count."""
        return walker

    def _moved(
        self, walker: Walker, held: frozenset[str], mouse: tuple[float, float], seconds: float
    ) -> Walker:
        return moved(walker, held, mouse, seconds, self._scene)

    def _render(self, walker: Walker) -> Walker:
        """Draw what a walker sees, and return where the eye was and where it looked."""
        focal_length = focal_length_of(self.display)
        self.pictures.render(
            Camera(walker.position, walker.azimuth, walker.altitude, focal_length=focal_length)
        )
        self.pictures.encode()
        return walker

    def _show(self, walker: Walker, refresh: int, onset: float | None) -> float:
        window = self._devices.window
        self._seen = self._render(walker)
        factor = self._factor
        if self.dimmer is not None:
            factor = self.dimmer.next_factor(0.0 if onset is None else self._due() - onset)
        picture = DimmedImage(self._image, self._brightness.of_picture(factor), self._black)
        self._renderer.draw(window.framebuffer(), picture, refresh, NOISE_SEED)
        self._screenshots.take(window, "walk")
        flip = window.flip()
        self._brightness.after_flip()
        self.recording.note(flip, refresh, factor, self._brightness.reported())
        self.heads += heads_of(window)
        return flip

    def _due(self) -> float:
        """Return when a picture appears that is drawn now, if this very refresh is caught [s]."""
        return self._devices.window.now() + 1 / self._devices.rig.refresh_rate


def write_path(
    file: Path, scene: str, way: Sequence[tuple[float, Walker]], through: CameraPath | None = None
) -> None:
    """Write a way as a camera path, which `render` and `optimize` take in place of a sequence's name.

    Parameters
    ----------
    file : Path
        To end in .json.
    scene : str
        Name of the scene.
    way : sequence of (float, Walker)
        Times from 0 on [s], and where the walker was then.
    through : CameraPath, optional
        Whose scene it is, in what light and on what ground.
    """
    kept = [way[0]]
    for moment in way[1:-1]:
        if kept[-1][0] + RECORDED_EVERY <= moment[0] <= way[-1][0] - RECORDED_EVERY:
            kept.append(moment)
    points = [
        {
            "name": f"moment {number}",
            "time_s": round(time, 3),
            "position_m": [round(coordinate, 3) for coordinate in walker.position],
            "azimuth_deg": round(walker.azimuth, 2),
            "altitude_deg": round(walker.altitude, 2),
        }
        for number, (time, walker) in enumerate([*kept, way[-1]], start=1)
    ]
    said = json.loads(through.text) if through and through.text else {}
    if through is not None:
        scene = through.scene
        if is_scene_file(scene):
            scene = Path(os.path.relpath(scene, file.parent)).as_posix()
    path = {"scene": scene, "duration_s": points[-1]["time_s"], "keypoints": points}
    path |= {key: said[key] for key in ("sky", "sun", "walkable") if key in said}
    write_whole(file, json.dumps(path, indent=1) + "\n")
