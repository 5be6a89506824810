"""A ring search on a stage: as it goes on, on a window, and the ring's picture without one.

The scene is drawn again where the view has turned; the dithering noise is new in every refresh. Where a
machine draws more slowly than its display refreshes, missed refreshes are counted: time is that of the clock.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.rig import Rig
from evenlight.experiments.recordings import DECIMALS, Refreshes
from evenlight.experiments.showing import Screen, settle
from evenlight.experiments.stage import KEY_DECIMALS, SearchResult, SearchView
from evenlight.hardware.protocols import KeyPress, Pointer
from evenlight.method.contrast.luminance import emitted_luminance
from evenlight.stimuli.image_renderer import DimmedImage, EyeImages, Image
from evenlight.stimuli.renderers import AnyFieldRenderer, image_renderer
from evenlight.stimuli.rings.landolt import GAPS_IN_DIAMETER, LEVELS_16, Ring, gap_pixels
from evenlight.stimuli.rings.ring_scene import RingScene
from evenlight.stimuli.scenes.content.catalogue import scene_searched
from evenlight.stimuli.scenes.engine.antialiasing import LIVE
from evenlight.stimuli.scenes.engine.camera import Camera, LookingAround, focal_length_of
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer
from evenlight.stimuli.scenes.engine.scene import Vector

Presses = Callable[[], list[KeyPress]]
OpenPointer = Callable[[], Pointer | None]
SIDE = 4  # of a picture, in diameters of its ring: beyond, nothing changes its visibility
SMALLEST_SIDE, LARGEST_SIDE = 64, 1024  # [pixels]
ANGLE_DECIMALS = 6  # [deg] a thousandth of a pixel


class SearchTracker:
    """Follows the keys, and notes each refresh, of one search.

    Parameters
    ----------
    view : SearchView
        What is searched.
    rig : Rig
        Refresh rate and keys.
    pixels_per_degree : float
        Of the display, for movements of a mouse.
    """

    def __init__(self, view: SearchView, rig: Rig, pixels_per_degree: float) -> None:
        self._time_limit, self._found_key = view.time_limit, rig.keys.found
        self._half_a_refresh = 0.5 / rig.refresh_rate
        self._turns = {
            rig.keys.turn_left: (-1, 0),
            rig.keys.turn_right: (1, 0),
            rig.keys.turn_up: (0, 1),
            rig.keys.turn_down: (0, -1),
        }
        self.looking = LookingAround(view.camera.altitude, view.field_of_view, pixels_per_degree)
        self.refreshes = Refreshes(rig.refresh_rate)
        self._directions: list[tuple[float, float]] = []
        self._factors: list[float] = []
        self._last_flip = 0.0
        self._found_after: float | None = None

    @property
    def over(self) -> bool:
        """Whether the key was pressed, or the last refresh before the time limit was shown."""
        if self._found_after is not None:
            return True
        shown = len(self.refreshes) > 0
        return shown and self._last_flip - self.refreshes.onset >= self._time_limit - self._half_a_refresh

    def direction(self, now: float) -> tuple[float, float]:
        """Return the direction of view at a time: azimuth from the first one, and altitude [deg]."""
        azimuth, altitude = self.looking.direction(now)
        return round(azimuth, ANGLE_DECIMALS), round(altitude, ANGLE_DECIMALS)

    def note(self, flip: float, direction: tuple[float, float], factor: float | None = None) -> None:
        """Note a refresh: when it appeared [s], where one looked, and what the backlight reported."""
        self.refreshes.note(flip)
        self._last_flip = flip
        self._directions.append(direction)
        if factor is not None:
            self._factors.append(factor)

    def take(self, presses: Iterable[KeyPress]) -> None:
        """Take keys that were pressed since the last refresh, each at its own time."""
        for press in presses:
            if press.name in self._turns:
                right, up = self._turns[press.name]
                self.looking.turn(right, up, press.time)
            elif press.name == self._found_key and self._found_after is None:
                after = round(press.time - self.refreshes.onset, KEY_DECIMALS)
                # What was pressed before the scene was there, or too late, finds nothing.
                if 0 <= after <= self._time_limit:
                    self._found_after = after

    def result(self, background_luminance: float) -> SearchResult:
        """Return how it went."""
        return SearchResult(
            onset=self.refreshes.onset,
            found_after=self._found_after,
            flip_times=self.refreshes.times(),
            azimuths=tuple(azimuth for azimuth, _ in self._directions),
            altitudes=tuple(altitude for _, altitude in self._directions),
            background_luminance=round(background_luminance, DECIMALS),
            backlight_factors=tuple(self._factors),
            frames_dropped=self.refreshes.dropped(),
        )


class LookedAt(Protocol):
    """A scene with a ring in it, that is looked around in."""

    image: Image | EyeImages  # what is seen
    background_luminance: float  # mean luminance around the ring [cd/m^2]

    def draw(self, searching: SearchTracker, now: float) -> tuple[float, float]:
        """Draw what is seen at a time [s], and return in which direction: from the first, and up [deg]."""


class SceneOnScreen:
    """A scene with a ring in it on a screen; it is drawn again where the view has turned.

    Parameters
    ----------
    scene : RingScene
        The scene.
    view : SearchView
        Ring, and where from.
    """

    def __init__(self, scene: RingScene, view: SearchView) -> None:
        self._scene, self._camera = scene, view.camera
        self._painted = scene.paint(view.ring, view.camera.position)
        self._last: tuple[float, float] | None = None
        self.image: Image | EyeImages = Image(scene.texture, LEVELS_16 + 1)
        self.background_luminance = self._painted.surroundings.luminance

    def draw(self, searching: SearchTracker, now: float) -> tuple[float, float]:
        """Draw what is seen at a time [s], and return in which direction: from the first, and up [deg]."""
        direction = searching.direction(now)
        if direction != self._last:
            azimuth = self._camera.azimuth + direction[0]
            camera = dataclasses.replace(self._camera, azimuth=azimuth, altitude=direction[1])
            self._scene.draw(camera, self._painted)
            self._last = direction
        return direction


class SearchPlayer:
    """Shows searches on a window.

    Parameters
    ----------
    showing : Screen
        What is shown on.
    fields : FieldRenderer or EyeFieldRenderer
        Draws what comes before a scene.
    presses : callable
        Returns the keys pressed since the last call, or raises `PausePressed`.
    open_pointer : callable
        Returns the mouse, which is held for the length of a search; None where there is none.
    """

    def __init__(
        self, showing: Screen, fields: AnyFieldRenderer, presses: Presses, open_pointer: OpenPointer
    ) -> None:
        window = showing.window
        self._on, self._fields, self._presses, self._open_pointer = showing, fields, presses, open_pointer
        self._renderer = image_renderer(window, showing.display, showing.rig.dither)
        self._black = showing.display.black_level + showing.display.reflected_luminance
        self._scenes: dict[str, RingScene] = {}

    def prepare(self, name: str) -> None:
        """Make a scene ready, where it is not yet: its light is computed, or read from the cache."""
        self._scene(name)

    def search(self, view: SearchView, ground: float) -> SearchResult:
        """Show a scene until the key `found` is pressed or the time is over.

        Raises `PausePressed` if the pause key was pressed.

        Parameters
        ----------
        view : SearchView
            What.
        ground : float
            L of the uniform field that was shown before it [cd/m^2].

        Raises
        ------
        InputError
            If there is no such scene, or the display cannot show the ring.
        """
        display = self._on.display
        camera = dataclasses.replace(view.camera, focal_length=focal_length_of(display))
        view = dataclasses.replace(view, camera=camera)
        looked_at = self._looked_at(view)
        searching = SearchTracker(view, self._on.rig, display.pixels_per_degree)
        settle(self._on, self._fields, view.factor, ground)
        with _held(self._open_pointer()) as pointer:
            self._presses()
            self._show(view, searching, looked_at, pointer)
        return searching.result(looked_at.background_luminance)

    def _show(
        self,
        view: SearchView,
        searching: SearchTracker,
        looked_at: LookedAt,
        pointer: Pointer | None,
    ) -> None:
        window, brightness = self._on.window, self._on.brightness
        for due in searching.refreshes.due(window):
            if searching.over:
                return
            onset = searching.refreshes.onset if len(searching.refreshes) else window.now()
            if pointer is not None:
                searching.looking.moved(*pointer.moved())
            direction = looked_at.draw(searching, onset + due)
            picture = DimmedImage(looked_at.image, brightness.of_picture(view.factor), self._black)
            refresh = len(searching.refreshes)
            self._renderer.draw(window.framebuffer(), picture, refresh, view.noise_seed)
            self._on.mark("search")
            flip = self._on.flip("search", Path(view.scene).stem)
            searching.note(flip, direction, brightness.reported())
            searching.take(self._presses())

    def _looked_at(self, view: SearchView) -> LookedAt:
        return SceneOnScreen(self._scene(view.scene), view)

    def _scene(self, name: str) -> RingScene:
        if name not in self._scenes:
            window = self._on.window
            renderer = SceneRenderer(window.context(), scene_searched(name), window.size(), antialiasing=LIVE)
            self._scenes[name] = RingScene(window.context(), renderer, self._on.display)
        return self._scenes[name]


def _held(pointer: Pointer | None) -> AbstractContextManager[Pointer | None]:
    """Return a context that closes the pointer at its end, if there is one."""
    return nullcontext() if pointer is None else closing(pointer)


@dataclass(frozen=True, slots=True, eq=False)
class RingPicture:
    """A ring and what is around it, the ring in the middle."""

    in_scene: Array  # (side, side): I, luminance emitted at b = 1 [cd/m^2]
    background_luminance: float  # mean luminance around the ring, of which its contrast is a share [cd/m^2]


class OffscreenPainter(AbstractContextManager["OffscreenPainter"]):
    """Draws rings in their scenes, without a window.

    Parameters
    ----------
    display : Display
        What shows them, pixel for pixel.
    side : int
        Of the pictures that are drawn, at least: `picture_side` of the largest ring, where that is known. A
        scene that is open for smaller pictures takes long to be opened for larger ones [pixels].

    Raises
    ------
    InputError
        If the machine has no OpenGL.
    """

    def __init__(self, display: Display, side: int = 0) -> None:
        from evenlight.stimuli.scenes.engine.graphics import offscreen_context

        self._display, self._side = display, side
        self._context = offscreen_context()
        self._scenes: dict[str, RingScene] = {}

    def picture(self, scene: str, position: Vector, ring: Ring) -> RingPicture:
        """Return a ring in a scene, seen from a position [m]."""
        needed = picture_side(ring, self._display)
        drawn = self._scene(scene, max(needed, self._side))
        painted = drawn.paint(ring, position)
        camera = Camera(position, ring.azimuth, ring.altitude, focal_length=focal_length_of(self._display))
        drawn.draw(camera, painted)
        edge = (drawn.size[0] - needed) // 2
        seen = drawn.pixel_values()[edge : edge + needed, edge : edge + needed]
        return RingPicture(emitted_luminance(seen, self._display), painted.surroundings.luminance)

    def __exit__(self, *_: object) -> None:
        self._scenes.clear()
        self._context.release()

    def _scene(self, name: str, side: int) -> RingScene:
        if name not in self._scenes or self._scenes[name].size[0] < side:
            renderer = SceneRenderer(self._context, scene_searched(name), (side, side))
            self._scenes[name] = RingScene(self._context, renderer, self._display)
        return self._scenes[name]


def picture_side(ring: Ring, display: Display) -> int:
    """Return how large the picture of a ring is, each way [pixels].

    >>> lab = Display("lab", 100.0, 0.0, 2.2, pixels_per_degree=60.0)
    >>> picture_side(Ring(0.0, 0.0, gap=10.0, contrast=-0.3, orientation=90), lab)
    200
    """
    side = SIDE * GAPS_IN_DIAMETER * gap_pixels(ring, display.pixels_per_degree)
    return 2 * math.ceil(min(max(side, SMALLEST_SIDE), LARGEST_SIDE) / 2)
