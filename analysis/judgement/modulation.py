"""How visible the movement of a track is to a judge from elsewhere: ColorVideoVDP.

Mantiuk et al., "ColorVideoVDP: A visual difference predictor for image, video and display distortions" (ACM
Transactions on Graphics 43(4):129, 2024), takes the sensitivity of both videos from the reference and the
contrast of each from its own background, so that it sees no constant dimming at all (docs/validity.md). It
does see movement. The reference is therefore the same stretch dimmed evenly to the track's mean factor there:
light is the same on the average, and only the movement differs. Even dimming with a flicker that most people
see is judged beside it, because the scale says little by itself.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack
from evenlight.data_schema.tracks.judgement import ModulationStretch
from evenlight.method.contrast.luminance import dimmed_luminance, drawn_luminance, linear_channels
from evenlight.stimuli.video.frame_conversion import coarser
from evenlight.stimuli.video.video_source import VideoSource, frames_at
from evenlight.stimuli.video.viewing_geometry import seen_video

PACKAGE = "pycvvdp"
STRETCHES = 2  # at most: those in which the track moves most
LENGTH = 1.2  # [s] of a stretch; the metric looks back 0.25 s
MOST_PIXELS = 160 * 90  # of a frame; larger ones are averaged to fewer
SLOWEST = 12.0  # [Hz] of frames; below, neither movement nor a flicker of 5 Hz can be shown
FLICKER, FLICKER_FREQUENCY = 0.02, 5.0  # of the factor, either way; [Hz]
BEST = 10.0  # JOD of no difference
Light = NDArray[np.float32]  # (frames, height, width, 3) linear R, G, B that reach the eye [cd/m^2]
# Compares two stretches: their light, frames per second, pixels per degree, highest luminance [cd/m^2].
Metric = Callable[[Light, Light, float, float, float], float]


def installed_metric() -> Metric | None:
    """Return ColorVideoVDP, None where the extra `judge` is not installed."""
    return colour_video_vdp if importlib.util.find_spec(PACKAGE) else None


def colour_video_vdp(
    test: Light, reference: Light, frames_per_second: float, pixels_per_degree: float, peak: float
) -> float:
    """Return the quality of a stretch beside its reference, by ColorVideoVDP on the processor [JOD]."""
    import pycvvdp
    import torch

    torch.set_num_threads(1)  # on small frames threads wait for each other: 20 times as slow when busy
    height, width = test.shape[1:3]
    metric = pycvvdp.cvvdp(
        display_photometry=pycvvdp.vvdp_display_photo_eotf(
            Y_peak=peak, contrast=1e6, source_colorspace="sRGB", EOTF="linear", E_ambient=0, k_refl=0
        ),
        display_geometry=pycvvdp.vvdp_display_geometry([width, height], ppd=pixels_per_degree),
        quiet=True,
        device=torch.device("cpu"),
    )
    with torch.no_grad():
        jod, _ = metric.predict(test, reference, dim_order="FHWC", frames_per_second=frames_per_second)
    return min(float(jod), BEST)


def judged_modulation(
    source: VideoSource, display: Display, track: BrightnessTrack, metric: Metric | None
) -> tuple[tuple[ModulationStretch, ...], str]:
    """Return how visible a metric finds a track's movement where it moves most, and a note."""
    rate = 1 / float(np.median(np.diff(track.times))) if len(track.times) > 1 else 0.0
    if metric is None:
        return (), "ColorVideoVDP is not installed: pip install '.[judge]' in the checkout"
    if rate < SLOWEST:
        return (), f"ColorVideoVDP was not asked: {rate:.3g} frames a second are too few to show movement"
    length = round(LENGTH * rate)
    begins = busiest_stretches(track, length)
    if not begins:
        return (), "ColorVideoVDP was not asked: the track does not move"
    found = tuple(_judged(source, display, track, metric, (begin, length, rate)) for begin in begins)
    return found, f"the {len(found)} stretches of {LENGTH:g} s in which the track moves most"


def busiest_stretches(track: BrightnessTrack, length: int) -> tuple[int, ...]:
    """Return the first frames of stretches of so many frames in which the factor changes most, in order."""
    n = len(track.factors)
    moved = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(np.log(track.factors))))])
    ends = np.minimum(np.arange(n) + length, n) - 1
    travel = (moved[ends] - moved)[: max(n - length + 1, 1)]
    chosen: list[int] = []
    for begin in np.argsort(-travel, kind="stable"):
        apart = all(abs(int(begin) - other) >= length for other in chosen)
        if travel[begin] > 0 and apart and len(chosen) < STRETCHES:
            chosen.append(int(begin))
    return tuple(sorted(chosen))


def _judged(
    source: VideoSource,
    display: Display,
    track: BrightnessTrack,
    metric: Metric,
    stretch: tuple[int, int, float],
) -> ModulationStretch:
    """Return what the metric says of the track in a stretch (first frame, length, rate), and of a flicker."""
    begin, length, rate = stretch
    numbers = range(begin, min(begin + length, len(track.times)))
    emitted, pixels_per_degree = _emitted(source, display, track.header.field_of_view, numbers)
    light = drawn_luminance if track.header.actuator is Actuator.PIXELS else dimmed_luminance
    factors, times = track.factors[numbers], track.times[numbers]
    wave = np.where(np.sin(2 * np.pi * FLICKER_FREQUENCY * (times - times[0]) + 0.1) >= 0, 1.0, -1.0)
    mean = float(factors.mean())
    peak = float((1 + FLICKER) * emitted.max() + display.reflected_luminance)

    def seen(b: Array) -> Light:
        return light(emitted, b[:, None, None, None], display).astype(np.float32)

    even, flicker = seen(np.full(len(factors), mean)), mean * (1 + FLICKER * wave)
    ours, flickers = (metric(seen(b), even, rate, pixels_per_degree, peak) for b in (factors, flicker))
    return ModulationStretch(
        begin=float(times[0]),
        end=float(times[-1]),
        lowest_factor=float(factors.min()),
        highest_factor=float(factors.max()),
        jod=ours,
        jod_flicker=flickers,
    )


def _emitted(
    source: VideoSource, display: Display, field_of_view: float | None, numbers: range
) -> tuple[Light, float]:
    """Return the light of frames at full brightness, averaged to few pixels, and their pixels per degree."""
    shown, geometry = seen_video(frames_at(source, numbers), display, field_of_view or 0.0, source.name)
    display, (width, height) = geometry.display, geometry.shown_size
    fewer = min((MOST_PIXELS / (height * width)) ** 0.5, 1.0)
    size = max(round(height * fewer), 1), max(round(width * fewer), 1)
    small = coarser(shown, size, display.gamma) if fewer < 1 else shown
    linear = np.array([linear_channels(frame.pixel_values, display.gamma) for frame in small])
    emitted = display.black_level + (display.peak_luminance - display.black_level) * linear
    return emitted.astype(np.float32), display.pixels_per_degree * size[1] / width
