"""How the mean luminance of a video changes, by its modulation and its content, in a viewer's thresholds."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.ramp import Direction
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack
from evenlight.method.rate_limit import step_luminance

STRETCH = 5.0  # [s] of the paper's ramps, in which the thresholds were measured
SPANS = (1.25, 2.5, 5.0)  # [s] over which a change within a stretch is seen as one
STEP = 0.125  # [s] from one span looked at to the next
DARKEST = 0.01  # [cd/m^2] below it the threshold does not fall any more
# The slowest change [cd/m^2/s] that counts as one threshold: of luminance [cd/m^2], direction, span [s].
Thresholds = Callable[[Array, Direction, float], Array]


@dataclass(frozen=True, slots=True, eq=False)
class LuminanceCourse:
    """The mean luminance of a video over time, and what of its changes the modulation makes."""

    times: Array  # of its frames, from 0 [s]
    exposure: Array  # integral of the mean luminance up to each frame [cd s/m^2]
    # what modulation and content have added to the luminance up to each frame [cd/m^2]
    modulated: Array
    content: Array


def luminance_course(track: BrightnessTrack, factors: Array, display: Display) -> LuminanceCourse:
    """Return the course of a video's luminance, dimmed by some factors.

    From frame to frame D = b Ī + L_refl changes by Δb · (mean of the two Ī), which the modulation makes, and
    by (mean of the two b) · ΔĪ, which the content makes; together that is all.

    Parameters
    ----------
    track : BrightnessTrack
        A track of the video, from whose columns Ī follows.
    factors : array, (N,)
        b of each frame.
    display : Display
        For the light that it reflects.
    """
    full = (track.mean_luminance - display.reflected_luminance) / track.factors
    steps = np.diff(factors) * step_luminance(full), (factors[:-1] + factors[1:]) / 2 * np.diff(full)
    luminance = factors * full + display.reflected_luminance
    light = step_luminance(luminance) * np.diff(track.times)
    exposure, modulated, content = (_cumulated(step) for step in (light, *steps))
    return LuminanceCourse(np.asarray(track.times - track.times[0]), exposure, modulated, content)


def _cumulated(steps: Array) -> Array:
    """Return the sum of all steps before each frame, (N,)."""
    return np.concatenate([[0.0], np.cumsum(steps)])


@dataclass(frozen=True, slots=True, eq=False)
class BrightnessChanges:
    """The strongest changes of each stretch of a video, in multiples of a person's threshold."""

    # of the modulation, and of the content
    modulated: Array
    content: Array


def changes_in_thresholds(
    course: LuminanceCourse, thresholds: Thresholds, seconds: float | None = None
) -> BrightnessChanges:
    """Return the strongest changes of each stretch of a video, in multiples of a threshold.

    The video is cut into stretches of 5 s and a rest. In each, every span of 1.25, 2.5 and 5 s is taken: the
    net change from its beginning to its end, per second, over the threshold of a ramp so long at the mean
    luminance of the span. The largest counts, wherever in the stretch it lies.

    Parameters
    ----------
    course : LuminanceCourse
        The video's.
    thresholds : callable
        Threshold of (luminance [cd/m^2], direction, duration [s]), in cd/m^2/s.
    seconds : float, optional
        How much of it is seen, from its beginning [s].
    """
    end = float(course.times[-1]) if seconds is None else min(seconds, float(course.times[-1]))
    rows = [
        [
            _strongest(course, cumulated, (begin, until), thresholds)
            for cumulated in (course.modulated, course.content)
        ]
        for begin, until in _stretches(end)
    ]
    modulated, content = np.array(rows).T
    return BrightnessChanges(modulated, content)


def _stretches(end: float) -> Iterator[tuple[float, float]]:
    """Yield beginning and end of each stretch; a rest shorter than the shortest span is part of the last."""
    begin = 0.0
    while end - begin >= STRETCH + SPANS[0]:
        yield begin, begin + STRETCH
        begin += STRETCH
    yield begin, end


def _strongest(
    course: LuminanceCourse, cumulated: Array, stretch: tuple[float, float], thresholds: Thresholds
) -> float:
    """Return the largest change in a stretch, over any span, in multiples of its threshold."""
    largest = 0.0
    length = stretch[1] - stretch[0]
    for span in sorted({min(span, length) for span in SPANS} - {0.0}):
        begin = np.append(np.arange(stretch[0], stretch[1] - span, STEP), stretch[1] - span)
        rate = _gained(course.times, cumulated, begin, span) / span
        luminance = np.maximum(_gained(course.times, course.exposure, begin, span) / span, DARKEST)
        for direction, sign in ((Direction.UP, 1.0), (Direction.DOWN, -1.0)):
            largest = max(largest, float((sign * rate / thresholds(luminance, direction, span)).max()))
    return largest


def _gained(times: Array, cumulated: Array, begin: Array, span: float) -> Array:
    """Return by how much something cumulated grows over spans of a length, from where each begins [s]."""
    return np.asarray(np.interp(begin + span, times, cumulated) - np.interp(begin, times, cumulated))
