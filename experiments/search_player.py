"""Shows a scene with a ring, dimmed, to someone who looks around in it.

The scene is drawn anew where the view has turned; the dithering noise is new in every refresh. Where a
machine draws more slowly than its display refreshes, what was missed is counted: time is that of the clock.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from contextlib import AbstractContextManager, closing, nullcontext

from evenlight.experiments.searching import Searching
from evenlight.experiments.showing import Showing, settle
from evenlight.experiments.stage import Searched, SearchView
from evenlight.hardware.protocols import KeyPress, Pointer
from evenlight.stimuli.field_renderer import FieldRenderer
from evenlight.stimuli.image_renderer import Image, ImageRenderer, Picture
from evenlight.stimuli.ring_light import LEVELS_16, PaintedRing
from evenlight.stimuli.ring_scene import RingScene
from evenlight.stimuli.scenes.renderer import SceneRenderer
from evenlight.stimuli.scenes.scenes import scene_named
from evenlight.stimuli.viewing_geometry import focal_length_of

Presses = Callable[[], list[KeyPress]]
OpenPointer = Callable[[], Pointer | None]


class SearchPlayer:
    """Shows searches on a window.

    Parameters
    ----------
    showing : Showing
        What is shown on.
    fields : FieldRenderer
        Draws what comes before a scene.
    presses : callable
        Returns the keys pressed since the last call, or raises `PausePressed`.
    open_pointer : callable
        Returns the mouse, which is held for the length of a search; None where there is none.
    """

    def __init__(
        self, showing: Showing, fields: FieldRenderer, presses: Presses, open_pointer: OpenPointer
    ) -> None:
        window = showing.window
        self._on, self._fields, self._presses, self._open_pointer = showing, fields, presses, open_pointer
        self._renderer = ImageRenderer(window.context(), showing.display, window.bits(), showing.rig.dither)
        self._black = showing.display.black_level + showing.display.reflected_luminance
        self._scenes: dict[str, RingScene] = {}

    def prepare(self, name: str) -> None:
        """Make a scene ready, where it is not yet: its light is reckoned, or read from the cache."""
        self._scene(name)

    def search(self, view: SearchView, ground: float) -> Searched:
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
        scene = self._scene(view.scene)
        painted = scene.paint(view.ring, camera.position)
        searching = Searching(view, self._on.rig, display.pixels_per_degree)
        settle(self._on, self._fields, view.factor, ground)
        with _held(self._open_pointer()) as pointer:
            self._presses()
            self._show(view, searching, (scene, painted), pointer)
        return searching.result(painted.surroundings.luminance)

    def _show(
        self,
        view: SearchView,
        searching: Searching,
        drawn: tuple[RingScene, PaintedRing],
        pointer: Pointer | None,
    ) -> None:
        """Show the scene, refresh by refresh, until the search is over."""
        window, brightness = self._on.window, self._on.brightness
        scene, painted = drawn
        image, last = Image(scene.texture, LEVELS_16 + 1), None
        for due in searching.refreshes.due(window.now):
            if searching.over:
                return
            onset = searching.refreshes.onset if len(searching.refreshes) else window.now()
            if pointer is not None:
                searching.looking.moved(*pointer.moved())
            direction = searching.direction(onset + due)
            if direction != last:
                azimuth = view.camera.azimuth + direction[0]
                scene.draw(dataclasses.replace(view.camera, azimuth=azimuth, altitude=direction[1]), painted)
                last = direction
            picture = Picture(image, brightness.of_picture(view.factor), self._black)
            refresh = len(searching.refreshes)
            self._renderer.draw(window.framebuffer(), picture, refresh, view.noise_seed)
            self._on.screenshots.take(window, "search", view.scene)
            flip = window.flip()
            brightness.after_flip()
            searching.note(flip, direction, brightness.reported())
            searching.take(self._presses())

    def _scene(self, name: str) -> RingScene:
        """Return what draws a scene; each is made ready once, which takes its time."""
        if name not in self._scenes:
            window = self._on.window
            renderer = SceneRenderer(window.context(), scene_named(name), window.size())
            self._scenes[name] = RingScene(window.context(), renderer, self._on.display)
        return self._scenes[name]


def _held(pointer: Pointer | None) -> AbstractContextManager[Pointer | None]:
    """Return a context that closes the pointer at its end, if there is one."""
    return nullcontext() if pointer is None else closing(pointer)
