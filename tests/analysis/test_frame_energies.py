"""Claims about energies of frames: integrals from flip to flip, of what samples say and of no more."""

from __future__ import annotations

import numpy as np
import pytest

from evenlight.analysis.played_power.clock_line import ClockLine
from evenlight.analysis.played_power.pass_power import frame_energies
from evenlight.analysis.played_power.power_recording import Flips, Samples
from evenlight.data_schema.recordings.played_power import FrameEnergy, FrameFlag

SAME = ClockLine(0.0, 0.0)


def flips(times: list[float], frames: list[int], passes: list[int] | None = None) -> Flips:
    n = len(times)
    return Flips(
        pass_index=np.array(passes or [0] * n),
        video_frame=np.array(frames),
        version=np.array(["ours"] * n),
        flip=np.array(times),
        achieved_factor=np.linspace(0.2, 0.2 + 0.1 * (n - 1), n),
        sync=np.arange(n) % 2 == 0,
    )


def samples(power: list[float], step: float = 0.01, lost: tuple[int, ...] = ()) -> Samples:
    kept = np.array([k for k in range(len(power)) if k not in lost])
    time = step * kept
    return Samples(kept, time, time, np.array(power)[kept], np.zeros(len(kept), dtype=bool))


def energies(known: Samples, shown: tuple[Flips, float], line: ClockLine = SAME) -> list[FrameEnergy]:
    """The energies of frames that a display of some refresh rate has shown."""
    return frame_energies(known, *shown, line)


def test_a_frame_lasts_to_the_next_and_the_last_one_for_a_refresh() -> None:
    """Two refreshes of frame 0, one of frame 1, then a dropped one; frame 3 is the last, 0.1 s long."""
    found = energies(samples([1.0] * 200), (flips([1.0, 1.1, 1.2, 1.4], [0, 0, 1, 3]), 10.0))
    assert [frame.begun for frame in found] == [1.0, 1.2, 1.4]
    assert [frame.duration for frame in found] == pytest.approx([0.2, 0.2, 0.1])
    assert [frame.factor for frame in found] == pytest.approx([0.25, 0.4, 0.5])  # 0.2 and 0.3 for as long


def test_the_same_frame_in_the_next_pass_is_another_one() -> None:
    found = energies(samples([1.0] * 300), (flips([1.0, 2.0], [5, 5], [0, 1]), 10.0))
    assert [frame.duration for frame in found] == pytest.approx([0.1, 0.1])
    assert [frame.pass_index for frame in found] == [0, 1]


def test_frames_between_ends_of_samples_have_the_sums_of_their_means() -> None:
    """Frames of 20 ms and samples of 10 ms that end with them: (1 + 2) W · 10 ms, then (4 + 3) W · 10 ms."""
    shown = (flips([0.02, 0.04], [0, 1]), 50.0)
    found = energies(samples([9.0, 9.0, 9.0, 1.0, 2.0, 4.0, 3.0, 9.0]), shown)
    assert [frame.energy for frame in found] == pytest.approx([0.03, 0.07])
    assert [frame.power for frame in found] == pytest.approx([1.5, 3.5])
    assert [frame.n_samples for frame in found] == [2, 2]


def test_a_linear_rise_is_integrated_where_frames_cut_through_samples() -> None:
    """P = 1 + t; means over 10 ms are exact; frames of 1/60 s: ∫ = d + (t1² - t0²) / 2."""
    ends = 0.01 * np.arange(41)
    means = (1 + (ends - 0.005)).tolist()
    times = (0.1 + np.arange(10) / 60).tolist()
    shown = (flips(times, list(range(10))), 60.0)
    begun = np.array(times)
    ended = begun + 1 / 60
    true = 1 / 60 + (ended**2 - begun**2) / 2
    assert [frame.energy for frame in energies(samples(means), shown)] == pytest.approx(true, rel=2e-5)


def test_the_meters_clock_is_put_on_the_computers() -> None:
    """Half as fast and 5 s behind: a meter's second is two of the computer's, and 1 W makes 2 J of it."""
    line = ClockLine(reference=0.0, offset=5.0, drift=1.0)
    shown = (flips([5.2, 5.4], [0, 1]), 5.0)
    found = energies(samples([1.0] * 60), shown, line)
    assert [frame.energy for frame in found] == pytest.approx([0.2, 0.2])
    assert found[0].n_samples == 10  # one in 20 ms of the computer


def test_a_lost_sample_is_bridged_and_its_share_is_said() -> None:
    shown = (flips([0.02, 0.06], [0, 1]), 25.0)
    found = energies(samples([2.0] * 20, lost=(4,)), shown)
    assert [frame.energy for frame in found] == pytest.approx([0.08, 0.08])
    assert [frame.bridged_share for frame in found] == pytest.approx([0.25, 0.0])
    assert all(frame.flag is FrameFlag.OK for frame in found)


def test_frames_in_a_long_gap_have_no_energy() -> None:
    """Samples 10 to 19 are lost, 90 to 190 ms: frames of 50 ms from 50, 100 and 150 ms lie in it."""
    shown = (flips([0.0, 0.05, 0.1, 0.15, 0.2], [0, 1, 2, 3, 4]), 20.0)
    found = energies(samples([1.0] * 40, lost=tuple(range(10, 20))), shown)
    gap = FrameFlag.GAP
    assert [frame.flag for frame in found] == [FrameFlag.OK, gap, gap, gap, FrameFlag.OK]
    assert [frame.energy is None for frame in found] == [False, True, True, True, False]
    assert found[1].bridged_share == pytest.approx(0.2)


def test_frames_outside_the_samples_have_no_energy() -> None:
    """Samples from 0 to 0.19 s."""
    shown = (flips([-0.01, 0.05, 0.1, 0.15, 0.2], [0, 1, 2, 3, 4]), 20.0)
    found = energies(samples([1.0] * 20), shown)
    outside = FrameFlag.OUTSIDE
    assert [frame.flag for frame in found] == [outside, FrameFlag.OK, FrameFlag.OK, outside, outside]


def test_frames_shorter_than_samples_get_their_share_and_are_flagged() -> None:
    """A sample of 1 W in 50 ms, of darkness around it, for three frames: 1 W / 60 Hz each."""
    times = (0.1 + np.arange(3) / 60).tolist()
    dark = [0.2] * 3
    found = energies(samples([*dark, 1.0, *dark], step=0.05), (flips(times, [0, 1, 2]), 60.0))
    assert [frame.energy for frame in found] == pytest.approx([1 / 60] * 3)
    assert all(frame.flag is FrameFlag.UNRESOLVED for frame in found)


def test_power_below_zero_is_a_zero_error_and_stays() -> None:
    found = energies(samples([-0.001] * 20), (flips([0.02, 0.04], [0, 1]), 50.0))
    assert [frame.energy for frame in found] == pytest.approx([-2e-5, -2e-5])
