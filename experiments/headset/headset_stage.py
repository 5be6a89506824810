"""The stage of a session in a headset: as on a window, with controllers, and a log of head and frames.

Decision (docs/decisions/headset-photometry.md): text stands on a panel that moves with the head. A trial of
which a frame was not seen, because the headset was taken off, lost the focus or its tracking, is shown again.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.rig import Eye, Rig
from evenlight.experiments.headset.choices import Choice, answers_of, choice_image
from evenlight.experiments.headset.controllers import (
    NEXT,
    OPERATOR_KEYS,
    STICK_LEFT,
    STICK_RIGHT,
    TRIGGER,
    HeadsetKeys,
)
from evenlight.experiments.headset.headset_search import HeadsetSearchPlayer
from evenlight.experiments.playback.clip_player import PROBE_SIZE
from evenlight.experiments.sessions.dropped_frames import ShownStimulus
from evenlight.experiments.sessions.pages import Pages
from evenlight.experiments.sessions.window_stage import WindowStage
from evenlight.experiments.stage import (
    Clip,
    PausePressed,
    RampInterval,
    SearchResult,
    SearchView,
    ShownClip,
    ShownInterval,
    SkipPressed,
)
from evenlight.hardware.presentation.headset_views import HeadsetFrame
from evenlight.hardware.presentation.headset_window import PANEL_SIZE, HeadsetWindow, ShownFrame
from evenlight.hardware.presentation.mirror_window import STRIP_SIZE
from evenlight.hardware.protocols import KeyPress, ResponseDevice, TriggerOutput
from evenlight.stimuli.eyes.surfaces import PANEL_WIDTH, panel_matrix
from evenlight.stimuli.field_renderer import Field
from evenlight.stimuli.page_image import centred_image
from evenlight.stimuli.video.viewing_geometry import pixels_per_degree_in

NOT_WORN = "the headset was not worn, or something of the system was in front"
NOT_SHOWN = "the runtime did not show what was drawn"
NOT_TRACKED = "where the head is was not known"
RECENTRED = "straight ahead was set anew, by the runtime, by F4 or by the menu button"
BROKEN_OFF = "the operator broke it off"
NUMBER_SIZE = 3.0  # of an interval's number, as high as a heading, in multiples of a page's text
STRIP_TEXT = 0.5  # of its letters, in multiples of those of a page as wide
Shown = TypeVar("Shown", bound=ShownStimulus)


class HeadsetStage(WindowStage):
    """Shows a session in a headset.

    Parameters
    ----------
    window : HeadsetWindow
        The headset's.
    keyboard : ResponseDevice
        The operator's, or that of a simulated participant.
    rig, display, page_luminance : Rig, Display, float
        As of `WindowStage`.
    pages : Pages
        What answers are called.
    screenshots, triggers : Path, mapping of str to TriggerOutput, optional
        As of `WindowStage`.
    """

    def __init__(
        self,
        window: HeadsetWindow,
        keyboard: ResponseDevice,
        rig: Rig,
        display: Display,
        page_luminance: float,
        pages: Pages,
        *,
        screenshots: Path | None = None,
        triggers: Mapping[str, TriggerOutput] | None = None,
    ) -> None:
        keys = HeadsetKeys(window, keyboard, rig.keys)
        super().__init__(
            window, keys, rig, display, page_luminance, screenshots=screenshots, triggers=triggers
        )
        self._progress = ""
        self._headset, self._pages = window, pages
        self._number_size = NUMBER_SIZE
        self._text_pixels_per_degree = pixels_per_degree_in(PANEL_WIDTH, PANEL_SIZE[0])
        self._begun = False  # once open it may come off until the first page: the display alone is tried
        self._seen: list[Sequence[ShownFrame]] = []
        self._ahead = 0.0  # of the stage's clock before the runtime's, where it counts refreshes [s]
        self._choice = Choice(answers_of((), rig.keys, pages))
        self._choice_image = functools.lru_cache(16)(choice_image)
        self._leaving: KeyPress | None = None  # what leaves the page as soon as the headset is worn
        self._strip: str | None = None

    def prepare(self, pages: Sequence[str], questions: Sequence[str], font: Path | None = None) -> None:
        """Set some texts before the session begins, or raise `InputError` for one that cannot be shown."""
        super().prepare(pages, [], font)
        self._choice_image = functools.lru_cache(16)(functools.partial(choice_image, font=font))
        keys = self._rig.keys
        for question in questions:
            for asked in (keys.ratings, keys.orientations):  # the widest, and the highest answers
                self._choice_image(question, answers_of(asked, keys, self._pages), None, PANEL_SIZE)

    def show_page(self, text: str, keys: Sequence[str], footer: str = "") -> KeyPress:
        """Show a page until it is left, by a key of some or the trigger; not before the headset is worn."""
        self._begun, self._leaving = True, None
        self._caption("page")
        return super().show_page(text, keys, footer)

    def ask(self, question: str, keys: Sequence[str], luminance: float) -> KeyPress:
        """Show a question with its answers until one is taken. Raises `PausePressed` as `WindowStage.ask`."""
        self._choice = Choice(answers_of(keys, self._rig.keys, self._pages))
        self._caption("question")
        return super().ask(question, keys, luminance)

    def show_ramp(self, interval: RampInterval) -> ShownInterval:
        """Show an interval. Raises `PausePressed` if it was paused, or not seen."""
        return self._logged("ramp", functools.partial(super().show_ramp, interval))

    def play(self, clip: Clip) -> ShownClip:
        """Show a video. Raises `PausePressed` if it was paused, or not seen."""
        return self._logged("video", functools.partial(super().play, clip))

    def search(self, view: SearchView) -> SearchResult:
        """Show a scene to be searched. Raises `PausePressed` if it was paused, or not seen."""
        return self._logged("search", functools.partial(super().search, view))

    def tell(self, progress: str) -> None:
        """Say to the operator how far the session is, from the next page or stimulus on."""
        self._progress = progress

    def room(self) -> None:
        """Return None: what is shown lies around the head, however large."""

    def seen_in_headset(self) -> list[Sequence[ShownFrame]]:
        """Return the frames of each interval that was shown since the last call."""
        seen, self._seen = self._seen, []
        return seen

    @functools.cached_property
    def _search_player(self) -> HeadsetSearchPlayer:
        return HeadsetSearchPlayer(self._showing, self._renderer, self._search_presses, self._headset)

    def _logged(self, kind: str, show: Callable[[], Shown]) -> Shown:
        """Show an interval and keep its frames, the last ones; what came before was a number or a ground.

        Of an interval that is broken off all frames are kept.
        """
        self._caption(kind)
        self._headset.recentre()
        self._headset.shown_frames()
        try:
            shown = show()
        except PausePressed:
            self._keep(self._headset.shown_frames())
            raise
        frames = self._headset.shown_frames()[-len(shown.flip_times) :]
        self._ahead = shown.onset - frames[0].display_time
        self._keep(frames)
        unseen = (why_unseen(frame, frame.focused) for frame in frames)
        if self._begun and (why := next(filter(None, unseen), "")):
            raise PausePressed(why)
        return shown

    def _keep(self, frames: Sequence[ShownFrame]) -> None:
        """Keep the frames of an interval, their times on the stage's clock."""
        self._seen.append([replace(each, display_time=each.display_time + self._ahead) for each in frames])

    def _page_press(self, keys: Sequence[str]) -> KeyPress | None:
        """Return the press that leaves a page; one that goes on waits until the headset is worn."""
        proceed = keys[0] if keys else TRIGGER
        for press in self._keyboard.pressed():
            named = replace(press, name=proceed) if press.name in (TRIGGER, NEXT) else press
            if named.name == self._rig.keys.pause and named.name in keys:
                return named  # a pause, or the stop from there, needs nobody to wear it
            if named.name in keys or not keys:
                self._leaving = self._leaving or named
        return None if self._why_unseen() else self._leaving

    def _question_image(self, question: str) -> NDArray[np.uint8]:
        """Return the coverage of a question with its answers, one of which may be marked."""
        self._choice.look(self._headset.stick())
        return self._choice_image(question, self._choice.answers, self._choice.marked, PANEL_SIZE)

    def _answer(self, keys: Sequence[str]) -> KeyPress | None:
        """Return the answer that was taken since the last call, as the press of its key."""
        for press in self._presses():
            taken = self._choice.taken(press.name, self._headset.stick())
            if taken is not None:
                return KeyPress(taken, press.time)
        return None

    def _ground_drawn(self, field: Field) -> Callable[[], float] | None:
        """Return what reads the middle of the eye that counts, when the interval is over.

        Beside text it is the upper edge; nothing where the panel reaches up to there.
        """
        frame, text = self._headset.eyes(), field.coverage is not None
        eye = frame.eyes[self._rig.eye is Eye.RIGHT]
        _, _, width, height = eye.part
        matrix = panel_matrix(eye, (width, height), frame.head, PANEL_SIZE)
        if text and (matrix[1] @ [[0, width], 2 * [height / 8], [1, 1]]).max() >= 0:
            return None
        codes = self._headset.codes_later(PROBE_SIZE, top=text)
        return lambda: self._mean_luminance(codes())

    def _search_presses(self) -> list[KeyPress]:
        """Return presses as keys of a search: the trigger finds, the stick turns the room by steps."""
        keys = self._rig.keys
        names = {TRIGGER: keys.found, STICK_LEFT: keys.turn_left, STICK_RIGHT: keys.turn_right}
        return [replace(press, name=names.get(press.name, press.name)) for press in self._presses()]

    def _presses(self) -> list[KeyPress]:
        """Return what was pressed; raise `PausePressed` for a pause, or if the next frame is not seen."""
        presses = super()._presses()
        skipped = any(press.name == NEXT for press in presses)
        unseen = self._why_unseen()
        if self._begun and (skipped or unseen):
            self._forget_clip()
            raise SkipPressed(BROKEN_OFF) if skipped else PausePressed(unseen)
        return presses

    def _why_unseen(self) -> str:
        """Return why the next frame will not be seen, or not from where it is drawn; empty if it will."""
        return why_unseen(self._headset.eyes(), self._headset.focused())

    def _caption(self, kind: str) -> None:
        """Write for the operator what is shown; between stimuli, for a text takes longer than a frame."""
        mirror, text = self._headset.mirror, f"{self._progress}: {kind}. {OPERATOR_KEYS}"
        if mirror is not None and text != self._strip:
            page = centred_image(text, (STRIP_SIZE[0], STRIP_SIZE[0]), STRIP_TEXT)
            middle = (STRIP_SIZE[0] - STRIP_SIZE[1]) // 2
            mirror.say(np.ascontiguousarray(page[middle : middle + STRIP_SIZE[1]]))
            self._strip = text


def why_unseen(frame: HeadsetFrame | ShownFrame, focused: bool) -> str:
    """Return why a frame is not seen, or not from where it is drawn; empty if it is."""
    if not (focused and frame.visible):
        return NOT_SHOWN if focused else NOT_WORN
    if not frame.tracked:
        return NOT_TRACKED
    return RECENTRED if frame.recentred else ""
