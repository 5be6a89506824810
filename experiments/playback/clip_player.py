"""Shows a video with its brightness: each refresh the frame that is due then, stepped by its index.

Decision (docs/decisions/dimmed-playback.md): a refresh shows the frame of the time at which its flip is due,
counted from the clip's first flip. After a dropped refresh, or where the video has more frames a second than
the display, frames are left out; the clip is neither longer nor shorter, and the log says what was seen.
Decision (docs/decisions/frame-timing.md): in a headset that time is the predicted display time. A
scene is drawn for each refresh, and its factor goes evenly from frame to frame of the track. No step is
faster than the track, dropped refreshes and late frames or not (`TrackPace`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.errors import InputError
from evenlight.experiments.playback.clip_feeds import ClipFeeds, ImageFeed, part_of
from evenlight.experiments.playback.screen_geometry import shown_size
from evenlight.experiments.playback.track_pace import TrackPace
from evenlight.experiments.recordings import ClipRecording, Probe, frames_of_refreshes, probe_places
from evenlight.experiments.showing import Screen, settle
from evenlight.experiments.stage import Clip, ShownClip
from evenlight.method.contrast.luminance import dimmed_luminance
from evenlight.stimuli.dithering import level_luminance, mean_of_codes, mean_of_levels
from evenlight.stimuli.eyes.surfaces import FlatScreen, Surface
from evenlight.stimuli.field_renderer import Field
from evenlight.stimuli.image_renderer import DimmedImage, EyeImages, Image
from evenlight.stimuli.page_image import centred_image, ink_on
from evenlight.stimuli.ramp import frame_count
from evenlight.stimuli.renderers import AnyFieldRenderer, AnyImageRenderer, image_renderer
from evenlight.stimuli.scenes.scene_sequence import SceneSequence
from evenlight.stimuli.video.viewing_geometry import field_of_view_on

if TYPE_CHECKING:
    import moderngl

# [pixels] of the middle that is read back; the noise leaves a mean of so many within 0.01 cd/m^2 at 100.
PROBE_SIZE = (256, 256)
LABEL_SECONDS = 0.8  # that an interval's number is shown


class RefreshObserver(Protocol):
    """Who takes note of every refresh of a clip, as it is shown."""

    def begin(self) -> None:
        """Take note that a clip begins."""

    def before_flip(self, framebuffer: moderngl.Framebuffer, video_frame: int) -> None:
        """Draw a mark over a frame that is about to be shown, or nothing."""

    def after_flip(self, flip: float, video_frame: int, factor: float, achieved: float) -> None:
        """Take note of a frame that appeared [s], its brightness factor, and the one that was made of it."""


class ClipPlayer:
    """Shows clips on a window.

    Parameters
    ----------
    showing : Screen
        What is shown on.
    fields : FieldRenderer
        Draws what comes before a clip.
    surface : FlatScreen or Sphere, optional
        In a headset, what videos lie on; otherwise each on a screen as wide as its scale says.
    """

    def __init__(self, showing: Screen, fields: AnyFieldRenderer, surface: Surface | None = None) -> None:
        window = showing.window
        self._on, self._fields, self._surface = showing, fields, surface
        self._renderer = image_renderer(window, showing.display, showing.rig.dither)
        self._on_surfaces: dict[Surface, AnyImageRenderer] = {}
        self.recording: ClipRecording | None = None  # of the clip shown last, as far as it was
        self.caption: NDArray[np.uint8] | None = None  # coverage of text over the pictures
        self.observer: RefreshObserver | None = None
        self._feeds = ClipFeeds(window.context(), self._renderer, showing)
        self._black = showing.display.black_level + showing.display.reflected_luminance

    def prepare(self, clip: Clip) -> None:
        """Begin to read a clip; another one that was prepared and not played is let go."""
        self._feeds.prepare(clip)

    def close(self) -> None:
        """Let go of a clip that was prepared and not played."""
        self._feeds.close()

    def play(self, clip: Clip, ground: float) -> ShownClip:
        """Show a clip. Raises `PausePressed` if the pause key was pressed meanwhile.

        Parameters
        ----------
        clip : Clip
            What.
        ground : float
            L of the uniform field that was shown before it, and is shown until the clip can begin [cd/m^2].

        Raises
        ------
        InputError
            If a video that is shown as a whole is larger than the window, if it does not fit its track, or
            cannot be read to its end.
        """
        self.recording = None
        begun = self._on.window.now()
        with self._feeds.taken(clip) as feed:
            self._await(feed, ground)
            waited = self._on.window.now() - begun
            if clip.scale is None and not self._on.rig.in_headset:
                require_room(feed.size(), self._on.window.size())
            frames = frames_of_refreshes(clip, self._on.rig.refresh_rate)
            self._show_label(clip.label, ground)
            settle(self._on, self._fields, float(clip.factors[frames[0]]), ground)
            self.recording = ClipRecording(self._on.rig.refresh_rate, waited)
            if self.observer is not None:
                self.observer.begin()
            self._show_frames(clip, feed, frames, self._renderer_of(clip, feed))
        return self.recording.result()

    def _await(self, feed: ImageFeed, ground: float) -> None:
        """Show the uniform field until a clip can begin.

        On a clock that counts the refreshes no time passes while nothing is shown, and none is shown here: a
        rehearsal does not depend on how fast the machine decodes.
        """
        window, half_a_frame = self._on.window, 0.5 / self._on.rig.refresh_rate
        last, refresh = window.now(), 0
        while not feed.ready(half_a_frame):
            if window.now() > last:
                self._on.show(self._fields, Field(self._on.brightness.by_pixels(ground)), refresh)
                last, refresh = window.now(), refresh + 1

    def _show_label(self, label: str, ground: float) -> None:
        if not label:
            return
        number, ink = centred_image(label, self._on.window.size()), ink_on(ground, self._on.display)
        for refresh in range(frame_count(LABEL_SECONDS, self._on.rig.refresh_rate)):
            field = Field(self._on.brightness.by_pixels(ground), ink, number)
            self._on.show(self._fields, field, refresh, "label", label)

    def _renderer_of(self, clip: Clip, feed: ImageFeed) -> AnyImageRenderer:
        """Return what draws a clip: of a video in a headset, what draws on its surface."""
        if not self._on.rig.in_headset or isinstance(clip.video, SceneSequence):
            return self._renderer
        width = round(feed.size()[0] * (clip.scale or 1.0))
        surface = self._surface or FlatScreen(field_of_view_on(self._on.display, width))
        if surface not in self._on_surfaces:
            drawn_on = image_renderer(self._on.window, self._on.display, self._on.rig.dither, surface)
            self._on_surfaces[surface] = drawn_on
        return self._on_surfaces[surface]

    def _show_frames(
        self, clip: Clip, feed: ImageFeed, frames: NDArray[np.int64], renderer: AnyImageRenderer
    ) -> None:
        recording = self.recording
        assert recording is not None
        headset = self._on.rig.in_headset
        probes = [] if headset else probe_places(len(frames))  # nothing is read back there
        pace = TrackPace(clip)
        for time in recording.refreshes.due(self._on.window):
            place = round(time * self._on.rig.refresh_rate)
            if place >= len(frames):
                return
            probe = bool(probes) and place >= probes[0] and self.caption is None
            probes = [later for later in probes if later > place]
            frame = int(frames[place])
            moment = time if feed.for_each_refresh else float(clip.times[frame])
            factor = pace.factor(moment, time) if headset else float(clip.factors[frame])
            image = feed.image(frame, time)
            flip = self._show(clip, feed, image, frame, factor, renderer, probe)
            pace.shown(flip - recording.refreshes.onset)
            self._on.take_pause()

    def _show(
        self,
        clip: Clip,
        feed: ImageFeed,
        image: Image | EyeImages,
        frame: int,
        factor: float,
        renderer: AnyImageRenderer,
        probe: bool,
    ) -> float:
        window, brightness, recording = self._on.window, self._on.brightness, self.recording
        assert recording is not None
        pixels = brightness.of_picture(factor)
        white = float(dimmed_luminance(self._on.display.peak_luminance, pixels, self._on.display))
        picture = DimmedImage(image, pixels, self._black, max(white, self._black), self.caption)
        refresh = len(recording.refreshes)
        renderer.draw(window.framebuffer(), picture, refresh, clip.noise_seed)
        drawn = self._drawn(feed) if probe else None
        self._on.mark("video")
        self._on.screenshots.take(window, "clip")
        if self.observer is not None:
            self.observer.before_flip(window.framebuffer(), frame)
        flip = window.flip()
        brightness.after_flip()
        probed = (
            None if drawn is None else Probe(brightness.seen(drawn), self._intended(feed, picture, factor))
        )
        reported = brightness.reported()
        recording.note(flip, frame, factor, reported, probed)
        if self.observer is not None:
            self.observer.after_flip(flip, frame, factor, factor if reported is None else reported)
        return flip

    def _drawn(self, feed: ImageFeed) -> float:
        """Return the mean luminance drawn in the middle of the video, before its flip [cd/m^2]."""
        codes = self._on.window.read_codes(self._probe_size(feed))
        return mean_of_codes(codes, self._on.display, self._on.window.bits())

    def _intended(self, feed: ImageFeed, picture: DimmedImage, factor: float) -> float:
        """Return what that mean was to be, of the video's levels, the pixels' share, and the backlight's."""
        display = self._on.display
        levels, count = feed.levels()
        part = part_of(levels, self._on.window.size(), self._probe_size(feed))
        drawn = mean_of_levels(part, level_luminance(count, picture.factor, display))
        behind = factor / picture.factor
        return float(dimmed_luminance(drawn - display.reflected_luminance, behind, display))

    def _probe_size(self, feed: ImageFeed) -> tuple[int, int]:
        """Return width and height of the part that is read back [pixels]."""
        return shown_size(PROBE_SIZE, 1.0, shown_size(feed.size(), 1.0, self._on.window.size()))


def require_room(size: tuple[int, int], room: tuple[int, int]) -> None:
    """Refuse a video that is larger than a window and has no field of view: it is shown pixel by pixel."""
    (width, height), (whole, high) = size, room
    if width > whole or height > high:
        raise InputError(
            f"the video has {width}x{height} pixels, and the window {whole}x{high}: render it at --size "
            f"{whole}x{high}, or smaller, for it is shown pixel by pixel"
        )
