"""What is kept of a dimmed walk, and gains that were tuned elsewhere."""

import math

import pytest

from evenlight.data_schema.display import Display
from evenlight.data_schema.mapping import sha256_of_record
from evenlight.data_schema.tracks.control import LiveControl, LiveRefresh
from evenlight.experiments.playback.live_record import (
    LiveDimming,
    between_answers,
    dimming_in_words,
    live_control,
    over_time,
)
from evenlight.experiments.playback.play_options import LiveOptions
from evenlight.method.choices import LimitCurve
from evenlight.method.preset_files import load_rate_limit

BENCH = Display("bench", 104.4, 0.2, 1.95, 72.28)


def recorded(rows: list[LiveRefresh], curve: LimitCurve = LimitCurve.FITTED) -> LiveControl:
    asked = LiveOptions(0.03, limit_curve=curve)
    dimming = LiveDimming.asked_for(asked, BENCH, None, other_display_ok=True)
    return live_control(dimming, ("house", BENCH, "cpu"), rows, simulated=True)


def test_gains_are_those_that_are_asked_for_with_their_frame_rate() -> None:
    """A rate of 0 leaves the gains to the display's refreshes; what is not given is as in the paper."""
    asked = LiveOptions(target_loss=0.03, proportional=0.7, integral=0.02, gain_rate=45.0)
    settings = LiveDimming.asked_for(asked, BENCH, None, other_display_ok=True).controller.settings
    assert (settings.proportional, settings.integral, settings.derivative) == (0.7, 0.02, 0.05)
    assert (settings.gain_rate, settings.target_loss) == (45.0, 0.03)
    assert LiveOptions(target_loss=0.03, gain_rate=0.0).gains == {"gain_rate": None}


def test_a_walk_keeps_to_the_share_of_detections_that_is_asked_for() -> None:
    """By hand: ln(rate) moves by the width, 1.6, / (2 ln 19) for each unit of logit, from ln 3 to 0."""
    usual, half = (
        LiveDimming.asked_for(LiveOptions(0.03, noticed=share), BENCH, None, other_display_ok=True)
        for share in (None, 0.5)
    )
    ratio = half.controller.rate_limit(40.0) / usual.controller.rate_limit(40.0)
    assert ratio == pytest.approx(math.exp(-1.6 * math.log(3) / (2 * math.log(19))))
    kept = live_control(half, ("house", BENCH, "cpu"), [], simulated=True)
    assert (kept.noticed, kept.rate_limit, recorded([]).noticed) == (0.5, "surace2025", None)
    of_file = sha256_of_record(load_rate_limit("surace2025"))  # as a track's, by which the limit is found
    assert kept.provenance.inputs["rate_limit"] == of_file == recorded([]).provenance.inputs["rate_limit"]


def test_means_are_over_the_time_in_which_a_picture_stood() -> None:
    """Pictures of 1, 3 and 2 s, the last of which nobody knows: (0.5 + 3 · 0.7 + 2 · 0.6) / 6."""
    rows = [
        LiveRefresh(0, 0.0, 0.5),
        LiveRefresh(1, 1.0, 0.7, contrast_loss=0.2, rate=-3.0, rate_limit=4.0),
        LiveRefresh(2, 4.0, 0.6, contrast_loss=0.1, rate=1.0, rate_limit=2.0),
        LiveRefresh(3, 6.0, 1.0, contrast_loss=1.0, rate=0.0, rate_limit=0.0),
    ]
    kept = recorded(rows, LimitCurve.SAFE)
    assert kept.mean_loss == pytest.approx(0.8 / 5)
    assert kept.mean_factor == pytest.approx(3.8 / 6)
    assert kept.max_rate_ratio == 0.75
    assert (kept.limit_curve, kept.rate_limit, kept.simulated) == ("safe", "surace2025", True)
    assert set(kept.provenance.inputs) == {"display", "rate_limit"}


def test_a_walk_that_ended_at_once_has_no_means() -> None:
    kept = recorded([])
    assert (kept.mean_loss, kept.mean_factor, kept.max_rate_ratio) == (None, None, None)
    assert dimming_in_words(kept, None, []) == ""


def test_the_mean_of_a_single_picture_is_its_own() -> None:
    assert over_time([LiveRefresh(0, 0.0, 0.5)], [0.5]) == 0.5


def test_the_time_between_answers_is_from_one_that_is_new_to_the_next() -> None:
    """Answers appear at 0.1, 0.2 and 0.5 s: 0.1 and 0.3 s apart."""
    measured = [None, 0, 1, 1, 1, 4, 4]
    rows = [LiveRefresh(k, k / 10, 0.5, measured_refresh=one) for k, one in enumerate(measured)]
    assert between_answers(rows) == pytest.approx(0.2)
    assert between_answers(rows[:2]) is None


@pytest.mark.parametrize(("moves", "warned"), [(False, True), (True, False)])
def test_a_walk_that_gains_nothing_says_so_at_its_end(moves: bool, warned: bool) -> None:
    """Content that loses s (1 - b)^1.5, over more than a minute: constant dimming, or a loss that stays."""
    rows = []
    for k in range(140):
        strength = 0.1 + 0.05 * (k % 2)
        factor = 1 - (0.03 / strength) ** (1 / 1.5) if moves else 0.5
        loss = strength * (1 - factor) ** 1.5
        rows.append(LiveRefresh(k, k / 2, factor, loss, k, factor))
    said, soon = (dimming_in_words(recorded(some), None, some) for some in (rows, rows[:100]))
    assert ("; nothing is gained: the loss varies" in said) is warned
    assert "nothing is gained" not in soon  # under a minute
