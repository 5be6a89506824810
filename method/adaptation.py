"""Luminance adaptation of the cones over time: static and dynamic response (Section 4.4; Pattanaik 2000).

The static response is that of an eye that has adapted to what it sees; the dynamic one is that of an eye
which is still on its way. Their difference says how far adaptation lags behind the picture. Within a frame
the luminance is constant, so that both processes of adaptation are exponentials and are moved on exactly:
nothing depends on how often the picture is sampled. Rods are left out, as in the paper. See
docs/decisions/visual-adaptation.md.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenlight.data_schema.arrays import Array

# Constants of the cones: Pattanaik, Tumblin, Yee & Greenberg (2000), after Hunt (1995).
RESPONSE_EXPONENT = 0.73  # n
HALF_SATURATION_IN_THE_DARK = 12.9223  # [cd/m^2] 5 · 2^(1 / 0.73)
HALF_SATURATION_IN_LIGHT = 0.171  # of the term that takes over in the light
NEURAL_TIME = 0.080  # [s] t_0
BLEACHING_TIME = 110.0  # [s] tau
HALF_BLEACHING_LUMINANCE = 2e6  # [cd/m^2] at which half of the pigment is bleached

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)  # in each stretch of a frame; see `difference_samples`
_GROWTH = 3.0  # each stretch is so much longer than the one before; the first one has the neural time


@dataclass(frozen=True, slots=True)
class ConeState:
    """How far the cones of each pixel have adapted."""

    adaptation_luminance: Array  # A, the luminance that neural adaptation has reached [cd/m^2]
    unbleached_pigment: Array  # B, share of the pigment that is not bleached, in [0, 1]


def half_saturation(adaptation_luminance: ArrayLike) -> Array:
    """Return σ, the luminance of half the largest response, for cones adapted to A.

    σ = 12.9223 A / (k⁴A + 0.171 (1 - k⁴)² A^(1/3)), k = 1 / (5A + 1); written without its 0/0 in the dark.

    Parameters
    ----------
    adaptation_luminance : array_like, any shape
        A [cd/m^2], at least 0.

    >>> half_saturation(0.0).item()
    12.9223
    """
    luminance = np.asarray(adaptation_luminance, dtype=np.float64)
    k = 1 / (5 * luminance + 1)
    square = k * k
    rise = 5 * k * (1 + k) * (1 + square)  # (1 - k^4) / A
    in_light = HALF_SATURATION_IN_LIGHT * rise**2 * luminance * np.cbrt(luminance)
    return np.asarray(HALF_SATURATION_IN_THE_DARK / (square * square + in_light))


def steady_pigment(luminance: ArrayLike) -> Array:
    """Return B once bleaching and regeneration are in balance: 2e6 / (2e6 + L).

    >>> round(1 - steady_pigment(100.0).item(), 7)  # what a display bleaches
    5e-05
    """
    return np.asarray(HALF_BLEACHING_LUMINANCE / (HALF_BLEACHING_LUMINANCE + np.asarray(luminance)))


def cone_response(luminance: ArrayLike, state: ConeState) -> Array:
    """Return the response R = B Lⁿ / (Lⁿ + σ(A)ⁿ) of cones in some state of adaptation.

    Parameters
    ----------
    luminance : array_like, broadcast with the state
        L, what they see now [cd/m^2].
    state : ConeState
        A and B.

    Returns
    -------
    array
        R, in [0, 1].

    >>> dark = ConeState(np.array(0.0), np.array(1.0))
    >>> cone_response(12.9223, dark).item()
    0.5
    """
    seen = np.asarray(luminance, dtype=np.float64) ** RESPONSE_EXPONENT
    half = half_saturation(state.adaptation_luminance) ** RESPONSE_EXPONENT
    return np.asarray(state.unbleached_pigment * seen / (seen + half))


def adapted(luminance: ArrayLike) -> ConeState:
    """Return the state of cones that have adapted to a luminance [cd/m^2] for good."""
    values = np.array(luminance, dtype=np.float64)
    return ConeState(values, steady_pigment(values))


def static_response(luminance: ArrayLike) -> Array:
    """Return the response of cones that have adapted to the luminance which they see [cd/m^2]."""
    return cone_response(luminance, adapted(luminance))


def state_after(state: ConeState, luminance: ArrayLike, seconds: ArrayLike) -> ConeState:
    """Return the state after some time of a constant luminance: the exact solution of both equations.

    dA/dt = (L - A) / 0.08 s and dB/dt = (1 - B) / 110 s - L B / (110 s · 2e6 cd/m²).

    Parameters
    ----------
    state : ConeState
        At the start.
    luminance : array_like, broadcast with the state
        L, constant [cd/m^2].
    seconds : array_like, broadcast with them
        How long [s].

    >>> later = state_after(adapted(100.0), 0.0, NEURAL_TIME * np.log(2))  # half of the way
    >>> round(later.adaptation_luminance.item(), 9)
    50.0
    """
    goal, time = np.asarray(luminance, dtype=np.float64), np.asarray(seconds, dtype=np.float64)
    steady = steady_pigment(goal)
    neural = np.exp(-time / NEURAL_TIME)
    pigment = np.exp(-time / (BLEACHING_TIME * steady))  # a rate of (1 + L / 2e6) / 110 s
    return ConeState(
        goal + (state.adaptation_luminance - goal) * neural,
        steady + (state.unbleached_pigment - steady) * pigment,
    )


def difference_samples(state: ConeState, luminance: Array, seconds: float) -> tuple[Array, Array]:
    """Return |static - dynamic response| at some moments of a frame, and the time that each stands for.

    The difference dies away with the 80 ms of neural adaptation, so that the end of a frame says little of
    it. The moments are eight nodes of Gauss and Legendre in each stretch of 80, 240, 720 ms, ... that fill
    the frame, in the first one crowded to its start (at the cube of their place), where a step from dark to
    bright is over within milliseconds. Weighted sums are integrals over time. After a jump between any two of
    0.01 to 1000 cd/m², 1/90 to 1 s long, the integral is right to 4e-4 of itself, after one by a factor of 2
    to 2e-8.

    Parameters
    ----------
    state : ConeState
        When the frame appears, shape (...).
    luminance : array, (...)
        L of the frame [cd/m^2].
    seconds : float
        How long it is shown [s].

    Returns
    -------
    differences : array, (M, ...)
        |R_static - R_dynamic|, in [0, 1].
    weights : array, (M,)
        Time that each stands for [s]; they add up to `seconds`.
    """
    moments, weights = _moments(seconds)
    at = moments.reshape(-1, *(1,) * np.ndim(luminance))
    dynamic = cone_response(luminance, state_after(state, luminance, at))
    return np.abs(dynamic - static_response(luminance)), weights


def _moments(seconds: float) -> tuple[Array, Array]:
    place, share = (1 + _NODES) / 2, _WEIGHTS / 2
    lengths = [NEURAL_TIME]
    while sum(lengths) < seconds * (1 - 1e-12):
        lengths.append(lengths[-1] * _GROWTH)
    ends = np.cumsum(lengths) * (seconds / sum(lengths))
    nodes, weights = [ends[0] * place**3], [ends[0] * 3 * place**2 * share]
    for start, end in itertools.pairwise(ends.tolist()):
        nodes.append(start + (end - start) * place)
        weights.append((end - start) * share)
    return np.concatenate(nodes), np.concatenate(weights)


def adapting(luminance: NDArray[np.floating], durations: Array) -> Iterator[tuple[Array, Array]]:
    """Yield `difference_samples` of each frame of a video, the cones adapting from frame to frame.

    Parameters
    ----------
    luminance : array, (N, ...)
        L of each frame and pixel [cd/m^2]; the cones have adapted to the first frame when it appears.
    durations : array, (N,)
        How long each frame is shown [s].
    """
    state = adapted(luminance[0])
    for frame, seconds in zip(luminance, durations.tolist(), strict=True):
        goal = np.asarray(frame, dtype=np.float64)
        yield difference_samples(state, goal, seconds)
        state = state_after(state, goal, seconds)
