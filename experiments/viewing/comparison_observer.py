"""Simulated participants of artifact comparison: they see brightness change with the thresholds of the ramps.

Which of two versions of a video showed a change in brightness? Each stretch of 5 s gives some evidence, the
d' of the fastest change in it by the person's own psychometric function of two intervals, and noise of
standard deviation 1; the version with the strongest evidence is chosen. The baseline's brightness does not
change, so it has only noise. Both have changes of their content, which hide those of the modulation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy import special

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.recordings.ramp import Direction, Procedure, Response
from evenlight.data_schema.recordings.viewing import Version
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack
from evenlight.experiments.chance import Purpose
from evenlight.experiments.ramp.ramp_observer import (
    MEDIAN_RATE_LIMIT,
    ObserverPopulation,
    SimulatedObserver,
    draw_observer,
)
from evenlight.experiments.sessions.task import SessionSetting
from evenlight.experiments.stimulus_folder import LoadedStimulus
from evenlight.experiments.viewing.comparison_task import PlannedComparison
from evenlight.experiments.viewing.simulated_viewers import Viewing
from evenlight.method.preset_files import load_rate_limit
from evenlight.method.psychometric import WIDTH_LOGITS, PsychometricFunction
from evenlight.method.rate_limit import rate_limit_at, step_luminance

REFERENCE_LUMINANCE = 50.0  # [cd/m^2] any within a rate limit's range: thresholds keep their ratios elsewhere
STRETCH = 5.0  # [s] of the paper's ramps, in which the thresholds were measured
SPANS = (1.25, 2.5, 5.0)  # [s] over which a change within a stretch is seen as one
STEP = 0.125  # [s] from one span looked at to the next
DARKEST = 0.01  # [cd/m^2] below it the threshold does not fall any more
# The slowest change [cd/m^2/s] that counts as one threshold: of luminance [cd/m^2], direction, span [s].
Thresholds = Callable[[Array, Direction, float], Array]


@dataclass(frozen=True, slots=True)
class ComparisonPopulation:
    """Of whom simulated participants are drawn.

    Attributes
    ----------
    eyes : ObserverPopulation
        How their thresholds differ.
    masking : float
        How much the content's own changes hide: beside one of c thresholds, the threshold of the modulation's
        rises by sqrt(1 + (masking · c)²), so that by Weber's law for rates a change must be `masking` times
        as fast as the content's. 0 for no masking. 1 is a choice: with it the four sequences are told apart
        from their baselines about as rarely as in the paper (docs/decisions/simulated-viewers.md).
    bias_sd : float
        Standard deviation between persons of a leaning to the first interval, in units of d' (choice).
    """

    eyes: ObserverPopulation = field(default_factory=ObserverPopulation)
    masking: float = 1.0
    bias_sd: float = 0.2


@dataclass(frozen=True, slots=True)
class ComparisonObserver:
    """A participant whose truth is known.

    Attributes
    ----------
    eye : SimulatedObserver
        As in the ramp experiment.
    masking : float
        How much the content's own changes hide.
    bias : float
        Leaning to the first interval, in units of d'.
    """

    eye: SimulatedObserver
    masking: float = 0.0
    bias: float = 0.0

    def thresholds(self, luminance: Array, direction: Direction, span: float) -> Array:
        """Return the two-interval thresholds of ramps [cd/m^2/s]; arguments as of `Thresholds`."""
        function = self._function(direction, span)
        ratio = rate_limit_at(self.eye.limit, luminance) / rate_limit_at(self.eye.limit, REFERENCE_LUMINANCE)
        return np.asarray(function.threshold * ratio)

    def evidence(self, course: LuminanceCourse, seconds: float | None = None) -> Array:
        """Return d' of each stretch of a video, (stretches,), masked by its content's own changes."""
        changes = changes_in_thresholds(course, self.thresholds, seconds)
        raised = np.hypot(1.0, self.masking * changes.content)
        return d_prime(changes.modulated / raised, self._function(Direction.DOWN, STRETCH))

    def answer(self, evidence: Array, ours_interval: int, rng: np.random.Generator) -> Response:
        """Return which of the two versions is said to have changed in brightness.

        Parameters
        ----------
        evidence : array, (stretches,)
            d' of the modulated version, from `evidence`.
        ours_interval : int
            Which of the two is the modulated version, 1 or 2.
        rng : numpy.random.Generator
            Chance, of this trial alone.
        """
        noise = rng.standard_normal((2, len(evidence)))
        blind, coin = rng.random(2)
        ours, baseline = float(np.max(evidence + noise[0])), float(np.max(noise[1]))
        first, second = (ours, baseline) if ours_interval == 1 else (baseline, ours)
        says_first = coin < 0.5 if blind < self.eye.lapse_rate else first + self.bias > second
        return Response.FIRST if says_first else Response.SECOND

    def _function(self, direction: Direction, span: float) -> PsychometricFunction:
        """Return the two-interval function of ramps of a duration, at the reference luminance."""
        return self.eye.function_at(REFERENCE_LUMINANCE, Procedure.TWO_INTERVAL, direction, span)


def d_prime(multiples: Array, function: PsychometricFunction) -> Array:
    """Return d' of changes given in multiples of a two-interval threshold; lapses are left out.

    P(right) of who looks is 1/2 + F/2, F the rise of the psychometric function, and Φ(d'/√2) as well.

    >>> from evenlight.method.psychometric import WIDTH_LOGITS, PsychometricFunction
    >>> d_prime(np.array([0.0, 1.0]), PsychometricFunction(2.0, 1.6, guess_rate=0.5)).round(3).tolist()
    [0.0, 0.954]
    """
    with np.errstate(divide="ignore"):  # ln 0: no change, no evidence
        logit = function.threshold_logit + WIDTH_LOGITS * np.log(multiples) / function.width
    wrong = np.maximum(special.expit(-logit) / 2, np.finfo(float).tiny)
    return np.asarray(-np.sqrt(2) * special.ndtri(wrong)) + 0.0  # not -0


def draw_comparer(
    limit: RateLimit, rng: np.random.Generator, population: ComparisonPopulation | None = None
) -> ComparisonObserver:
    """Return a participant drawn from a population.

    Parameters
    ----------
    limit : RateLimit
        The median person's yes/no threshold over luminance.
    rng : numpy.random.Generator
        Chance.
    population : ComparisonPopulation, optional
        How participants differ.
    """
    people = population or ComparisonPopulation()
    eye = draw_observer(limit, (), rng, people.eyes)
    return ComparisonObserver(eye, people.masking, float(people.bias_sd * rng.standard_normal()))


def chance_of_choice(evidence: Array) -> float:
    """Return how often the version with some evidence is chosen, without lapses and leanings.

    P(max(d'_k + ε_k) > max ε_j), all ε standard normal: one minus the integral over x of the probability that
    all d'_k + ε_k lie below x, against the density of the other maximum.

    >>> round(chance_of_choice(np.zeros(12)), 9)
    0.5
    >>> round(chance_of_choice(np.array([0.954])), 3)  # one stretch: a single choice of two intervals
    0.75
    """
    x = np.linspace(-8.0, 8.0 + float(np.max(evidence, initial=0.0)), 4001)
    n = len(evidence)
    below = np.prod(special.ndtr(x[:, None] - evidence), axis=1)
    density = n * np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi) * special.ndtr(x) ** (n - 1)
    return float(1 - np.trapezoid(below * density, x))


@dataclass(frozen=True, slots=True, eq=False)
class LuminanceCourse:
    """The mean luminance of a video over time, and what of its changes the modulation makes.

    Attributes
    ----------
    times : array, (N,)
        Of its frames, from 0 [s].
    exposure : array, (N,)
        Integral of the mean luminance up to each frame [cd s/m^2].
    modulated, content : array, (N,)
        What modulation and content have added to the luminance up to each frame [cd/m^2].
    """

    times: Array
    exposure: Array
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
    """The strongest changes of each stretch of a video, in multiples of a person's threshold.

    Attributes
    ----------
    modulated, content : array, (stretches,)
        Of the modulation, and of the content.
    """

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


class ChangeViews:
    """The courses of some sequences, as they are compared in their two versions.

    Parameters
    ----------
    stimuli : sequence of LoadedStimulus
        The sequences.
    display : Display
        What they are shown on.
    """

    def __init__(self, stimuli: Sequence[LoadedStimulus], display: Display) -> None:
        self.courses = {
            stimulus.name: luminance_course(stimulus.track, stimulus.factors(Version.OURS), display)
            for stimulus in stimuli
        }

    def of(self, planned: PlannedComparison) -> LuminanceCourse:
        """Return the course of the modulated version of what a trial shows; the other has no modulation."""
        return self.courses[planned.sequence]


@dataclass(frozen=True, slots=True)
class ComparisonViewing(Viewing):
    """Artifact comparison: answers are `Response.FIRST` and `Response.SECOND`."""

    views: ChangeViews
    limit: RateLimit
    population: ComparisonPopulation = field(default_factory=ComparisonPopulation)
    purposes: tuple[Purpose, Purpose] = (Purpose.COMPARER, Purpose.COMPARISONS)

    def draw(self, rng: np.random.Generator) -> ComparisonObserver:
        """Return a participant."""
        return draw_comparer(self.limit, rng, self.population)

    def answer(
        self, person: ComparisonObserver, planned: PlannedComparison, rng: np.random.Generator
    ) -> Response:
        """Return which version is said to have changed in brightness."""
        evidence = person.evidence(self.views.of(planned), planned.seconds)
        return person.answer(evidence, planned.ours_interval, rng)

    def truth(self, person: ComparisonObserver) -> dict[str, Any]:
        """Return a participant's traits, and how often they would choose each modulated version."""
        sequences = [
            {"sequence": name, "chosen_without_lapses": chance_of_choice(person.evidence(course))}
            for name, course in self.views.courses.items()
        ]
        eye = {"sensitivity": person.eye.sensitivity, "lapse_rate": person.eye.lapse_rate}
        return {**eye, "masking": person.masking, "bias": person.bias, "sequences": sequences}

    def shared_truth(self) -> list[dict[str, Any]]:
        """Return whose thresholds the median person's are; how strong a change is depends on who sees it."""
        return [{"rate_limit": self.limit.name}]


def comparison_viewing(setting: SessionSetting) -> ComparisonViewing:
    """Return what simulated participants of a comparison see in a setting."""
    return ComparisonViewing(
        ChangeViews(setting.stimuli, setting.display), load_rate_limit(MEDIAN_RATE_LIMIT)
    )
