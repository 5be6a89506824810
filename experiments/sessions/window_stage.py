"""The stage of a real session, and of a rehearsal that is seen: pages, ramps and questions on a window."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.rig import Actuator, Rig
from evenlight.experiments.playback.clip_feeds import part_of
from evenlight.experiments.playback.clip_player import PROBE_SIZE, ClipPlayer
from evenlight.experiments.recordings import LUMINANCE_DECIMALS, Probed, RampRecording, probe_places
from evenlight.experiments.sessions.marked_window import MarkedWindow
from evenlight.experiments.sessions.search_stage import OpenPointer, SearchPlayer
from evenlight.experiments.showing import Brightness, Screen, Screenshots
from evenlight.experiments.stage import (
    KEY_DECIMALS,
    Clip,
    PausePressed,
    RampInterval,
    SearchResult,
    SearchView,
    SentTrigger,
    ShownClip,
    ShownInterval,
    Stage,
)
from evenlight.hardware.protocols import Backlight, KeyPress, ResponseDevice, TriggerOutput, Window
from evenlight.stimuli.dithering import luminance_of_codes
from evenlight.stimuli.field_renderer import Field
from evenlight.stimuli.fixation_mark import fixation_mark
from evenlight.stimuli.page_image import centred_image, ink_on, page_image
from evenlight.stimuli.ramp import frame_count, ramp_luminance, require_reachable
from evenlight.stimuli.renderers import field_renderer

LONGEST_SETTLING = 0.25  # [s] that a backlight is waited for before a ramp
LABEL_GONE_BEFORE = 0.3  # [s]
LABEL_SIZE = 1.0  # of an interval's number, in multiples of a page's text


class WindowStage(Stage):
    """Shows a session on a window.

    Parameters
    ----------
    window : Window
        The window; its clock is the stage's.
    keyboard : ResponseDevice
        The keys, on the same clock.
    rig : Rig
        Refresh rate, dithering, actuator, and the pause key.
    display : Display
        The rig's calibrated display.
    page_luminance : float
        Of the ground of pages [cd/m^2]: near what the ramps have, so that reading changes no adaptation.
    backlight : Backlight, optional
        The backlight, if the rig has one.
    screenshots : Path, optional
        Folder for a picture of every kind of screen.
    open_pointer : callable, optional
        Returns the mouse that scenes are looked around in with; without one, keys turn the view.
    triggers : mapping of str to TriggerOutput, optional
        What is told when stimuli begin and end, by name.

    Raises
    ------
    InputError
        If the display does not reach the pages' luminance.
    """

    def __init__(
        self,
        window: Window,
        keyboard: ResponseDevice,
        rig: Rig,
        display: Display,
        page_luminance: float,
        backlight: Backlight | None = None,
        screenshots: Path | None = None,
        open_pointer: OpenPointer = lambda: None,
        triggers: Mapping[str, TriggerOutput] | None = None,
    ) -> None:
        require_reachable(page_luminance, page_luminance, 1.0, display, Actuator.PIXELS)
        self._window = MarkedWindow(window, rig, triggers)
        self._keyboard, self._backlight = keyboard, backlight
        self._rig, self._display, self._page_luminance = rig, display, page_luminance
        self._renderer = field_renderer(window, display, rig.dither)
        self._luminance_of_code = luminance_of_codes(np.arange(2 ** window.bits()), display, window.bits())
        self._brightness = Brightness(display, rig.actuator, backlight, window.now)
        self._screenshots, self._open_pointer = Screenshots(screenshots), open_pointer
        self._pixel_value = 1.0  # of the last uniform screen
        self._ground = page_luminance  # of the last uniform field
        self._frame = 0  # of what is not a ramp, for fresh noise
        self._shown: Field | None = None
        self._number_size = LABEL_SIZE
        self._text_pixels_per_degree = display.pixels_per_degree
        self._page_image = functools.lru_cache(32)(page_image)
        self._centred_image = functools.lru_cache(8)(centred_image)
        self._mark_image = functools.lru_cache(1)(fixation_mark)

    def now(self) -> float:
        """Return the time on the stage's clock [s]."""
        return self._window.now()

    def apparatus(self) -> dict[str, str]:
        """Return what the devices say of themselves."""
        return {**self._window.apparatus(), **self._keyboard.apparatus()}

    def prepare(self, pages: Sequence[str], questions: Sequence[str], font: Path | None = None) -> None:
        """Set some texts before the session begins, or raise `InputError` for one that cannot be shown."""
        self._page_image = functools.lru_cache(32)(functools.partial(page_image, font=font))
        self._centred_image = functools.lru_cache(8)(functools.partial(centred_image, font=font))
        for text in pages:
            self._page_image(text, self._window.size(), "")
        for text in questions:
            self._centred_image(text, self._window.size())

    def show_page(self, text: str, keys: Sequence[str], footer: str = "") -> KeyPress:
        """Show a page until one of some keys is pressed (any, where none is given); return which and when.

        The pause key does here what any other does.
        """
        image = self._page_image(text, self._window.size(), footer)
        ink = ink_on(self._page_luminance, self._display)
        self._keyboard.clear()
        while True:
            ground = self._brightness.by_pixels(self._page_luminance)
            self._show(Field(ground, ink, image), "page", text)
            if (press := self._page_press(keys)) is not None:
                return press

    def ask(self, question: str, keys: Sequence[str], luminance: float) -> KeyPress:
        """Show a question on a field of some luminance until one of the keys is pressed.

        The field has the pixel value of the last ramp. The time of the key press returned counts from the
        first flip that showed the question. Raises `PausePressed` if the pause key was pressed.
        """
        onset: float | None = None
        self._take_pause()
        while True:
            ground = self._brightness.of_screen(luminance, self._pixel_value)
            image = self._question_image(question)
            self._window.mark("question")
            flip = self._show(Field(ground, ink_on(ground, self._display), image), "question", question)
            onset = flip if onset is None else onset
            if (press := self._answer(keys)) is not None:
                self._window.send("answer")
                return KeyPress(press.name, round(max(0.0, press.time - onset), KEY_DECIMALS))

    def wait(self, seconds: float, luminance: float, pixel_value: float | None = None) -> None:
        """Show a uniform field for a time [s]. Raises `PausePressed` if the pause key was pressed.

        With a pixel value, the field's brightness is made as that of a ramp with it is; without, by pixels.
        """
        flip, end = 0.0, math.inf
        half_a_frame = 0.5 / self._rig.refresh_rate
        self._ground = luminance
        while seconds > 0 and flip < end - half_a_frame:
            if pixel_value is None:
                ground = self._brightness.by_pixels(luminance)
            else:
                ground = self._brightness.of_screen(luminance, pixel_value)
            flip = self._show(Field(ground), "field")
            end = min(end, flip + seconds)  # counted from the first flip: the clock may lag behind it
            self._take_pause()

    def show_ramp(self, interval: RampInterval) -> ShownInterval:
        """Show an interval. Raises `PausePressed` if the pause key was pressed meanwhile.

        Each frame has the luminance of the time at which its flip is due, so that a dropped frame leaves a
        gap in the ramp and does not make it longer.
        """
        recording = RampRecording(self._rig.refresh_rate)
        seconds = interval.adaptation + interval.duration + interval.hold
        n_frames = frame_count(seconds, self._rig.refresh_rate)
        probes = probe_places(n_frames)
        self._pixel_value = interval.pixel_value
        if interval.mark_contrast:
            self._mark_image(self._window.size(), self._text_pixels_per_degree)  # now, for it takes long
        self._settle(interval)
        for time in recording.refreshes.due(self._window):
            place = round(time * self._rig.refresh_rate)
            if place >= n_frames:
                break
            probe = bool(probes) and place >= probes[0]
            probes = [later for later in probes if later > place]
            self._show_frame(interval, time, recording, probe)
            self._take_pause()
        return recording.result()

    def prepare_clip(self, clip: Clip) -> None:
        """Begin to read a clip, so that it can begin when it is asked for."""
        self._clip_player.prepare(clip)

    def play(self, clip: Clip) -> ShownClip:
        """Show a video with its brightness. Raises `PausePressed` if the pause key was pressed meanwhile."""
        return self._clip_player.play(clip, self._ground)

    def room(self) -> tuple[int, int] | None:
        """Return width and height of the window [pixels]."""
        return self._window.size()

    def prepare_scene(self, name: str) -> None:
        """Make a scene ready to be searched, where it is not yet; the first time may take a while."""
        self._search_player.prepare(name)

    def search(self, view: SearchView) -> SearchResult:
        """Show a scene to look around in until the key `found` is pressed or the time is over.

        Raises `PausePressed` if the pause key was pressed.
        """
        return self._search_player.search(view, self._ground)

    @functools.cached_property
    def _search_player(self) -> SearchPlayer:
        return SearchPlayer(self._showing, self._renderer, self._presses, self._open_pointer)

    @functools.cached_property
    def _clip_player(self) -> ClipPlayer:
        return ClipPlayer(self._showing, self._renderer)

    @property
    def _showing(self) -> Screen:
        """What this stage shows on, for players."""
        return Screen(
            self._window,
            self._rig,
            self._display,
            self._brightness,
            self._screenshots,
            self._take_pause,
            self._window.mark,
        )

    def triggers_sent(self) -> list[SentTrigger]:
        """Return the triggers sent since the last call, in order."""
        return self._window.triggers_sent()

    def close(self) -> None:
        """Close window and devices."""
        self._forget_clip()
        for device in (self._backlight, self._keyboard, self._window):
            if device is not None:
                device.close()

    def _page_press(self, keys: Sequence[str]) -> KeyPress | None:
        """Return the first press of one of some keys, of any where none is given, since the last call."""
        pressed = self._keyboard.pressed()
        return next((press for press in pressed if press.name in keys or not keys), None)

    def _question_image(self, question: str) -> NDArray[np.uint8]:
        return self._centred_image(question, self._window.size())

    def _answer(self, keys: Sequence[str]) -> KeyPress | None:
        """Return the first press of one of some keys since the last call, or raise `PausePressed`."""
        return next((press for press in self._presses() if press.name in keys), None)

    def _show_frame(self, interval: RampInterval, time: float, recording: RampRecording, probe: bool) -> None:
        luminance = ramp_luminance(
            time,
            interval.initial_luminance,
            interval.final_luminance,
            interval.adaptation,
            interval.duration,
        )
        intended = round(float(luminance), LUMINANCE_DECIMALS)
        # The number is gone well before the ramp: its going must not be taken for the beginning of a change.
        labelled = time < max(interval.adaptation - LABEL_GONE_BEFORE, interval.adaptation / 2)
        field = self._ramp_field(interval, intended, labelled)
        self._renderer.draw(self._window.framebuffer(), field, len(recording), interval.noise_seed)
        self._shown = field
        half_a_frame = 0.5 / self._rig.refresh_rate
        within = -half_a_frame <= time - interval.adaptation < interval.duration - half_a_frame
        if within:
            self._window.mark("ramp")
        drawn = self._ground_drawn(field) if probe else None
        text = interval.label if labelled else ""
        self._screenshots.take(self._window, "ramp" if within or text else "field", text)
        flip = self._window.flip()
        self._brightness.after_flip()
        probed = self._brightness.seen(drawn) if isinstance(drawn, float) else drawn
        recording.note(flip, intended, self._brightness.reported(), probed)

    def _ground_drawn(self, field: Field) -> Probed | None:
        """Return the mean luminance drawn where no text is, before its flip [cd/m^2]."""
        codes = self._window.read_codes(PROBE_SIZE)
        if field.coverage is not None:
            read = codes.shape[1], codes.shape[0]
            codes = codes[part_of(field.coverage, self._window.size(), read) == 0]
        return self._mean_luminance(codes)

    def _mean_luminance(self, codes: NDArray[np.int64]) -> float:
        # Codes are counted, not turned into luminances one by one: this happens while the flip is waited for.
        counts = np.bincount(codes.ravel(), minlength=self._luminance_of_code.size)
        return float(counts @ self._luminance_of_code / counts.sum())

    def _ramp_field(self, interval: RampInterval, luminance: float, labelled: bool) -> Field:
        """Return the field of a frame of an interval, with the interval's number if it is to have one."""
        ground = self._brightness.of_screen(luminance, interval.pixel_value)
        if interval.label and labelled:
            image = self._centred_image(interval.label, self._window.size(), self._number_size)
            return Field(ground, ink_on(ground, self._display), image)
        if not interval.mark_contrast:
            return Field(ground)
        image = self._mark_image(self._window.size(), self._text_pixels_per_degree)
        return Field(ground, (1 + interval.mark_contrast) * ground, image)

    def _settle(self, interval: RampInterval) -> None:
        """Show the initial luminance until the backlight has it; pixels have it at once."""
        begun = self._window.now()
        while self._rig.actuator is Actuator.BACKLIGHT and self._window.now() - begun < LONGEST_SETTLING:
            ground = self._brightness.of_screen(interval.initial_luminance, interval.pixel_value)
            self._show(Field(ground), "field")
            self._take_pause()
            if self._brightness.reached():
                return

    def _show(self, field: Field, kind: str, text: str = "") -> float:
        """Show a field, or still the one before if the backlight is too bright for it; return when [s]."""
        if self._shown is None or self._brightness.takes_pixels():
            self._shown = field
        self._renderer.draw(self._window.framebuffer(), self._shown, self._frame)
        self._frame = (self._frame + 1) % (1 << 32)
        self._screenshots.take(self._window, kind, text)
        flip = self._window.flip()
        self._brightness.after_flip()
        return flip

    def _presses(self) -> list[KeyPress]:
        """Return the keys pressed, or raise `PausePressed` if the pause key is among them."""
        presses = self._keyboard.pressed()
        if any(press.name == self._rig.keys.pause for press in presses):
            self._forget_clip()
            raise PausePressed
        return presses

    def _forget_clip(self) -> None:
        """Let go of a clip that was prepared and is not played; where none was, there is no player either."""
        if "_clip_player" in vars(self):
            self._clip_player.close()

    def _take_pause(self) -> None:
        """Raise `PausePressed` if the pause key was pressed, and forget other keys: nothing is asked yet."""
        self._presses()
