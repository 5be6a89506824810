"""Who notices a track's changes, and a rate limit for another share of detections, its band widened."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import mapping_from_record, record_from_mapping, sha256_of_record
from evenlight.data_schema.provenance import sha256_of_bytes
from evenlight.data_schema.rate_limit import BandKind, RateLimit, RateLimitForm
from evenlight.data_schema.recordings.ramp import Procedure
from evenlight.method.detectability import limit_at_share, share_noticed, watched, window_ratios
from evenlight.method.preset_files import load_rate_limit
from evenlight.method.psychometric import PsychometricFunction, yes_probability

KNOWN = RateLimit(
    "lab", "d", "", RateLimitForm.RATE, (2.0,), (10.0, 100.0), procedure=Procedure.YES_NO, ramp_duration=5.0,
    width=1.6, guess_rate=0.05, lapse_rate=0.0, width_range=(1.28, 2.0), participant_sd=0.3,
    band_luminance=(10.0, 100.0), band_lower=(1.6, 1.5), band_upper=(2.5, 2.8),
)  # fmt: skip
FRAMES = np.full(50, 0.1)  # [s]: one ramp


def test_windows_are_ramps_by_where_they_get_to() -> None:
    rising = np.full(100, 0.5)  # 0.1 s each: two windows of 5 s
    np.testing.assert_allclose(window_ratios(rising, np.full(100, 0.1), 5.0), [0.5, 0.5])
    there_and_back = np.tile([0.8, -0.8], 50)
    np.testing.assert_allclose(window_ratios(there_and_back, np.full(100, 0.1), 5.0), 0.0, atol=1e-12)
    # 7.4 s are one window, 7.6 s two of 3.8 s; a frame may last longer than a window.
    assert len(window_ratios(np.ones(74), np.full(74, 0.1), 5.0)) == 1
    assert len(window_ratios(np.ones(76), np.full(76, 0.1), 5.0)) == 2
    np.testing.assert_allclose(window_ratios(np.array([0.3]), np.array([20.0]), 5.0), 0.3)


def test_each_period_counts_as_a_ramp_beyond_guesses_and_lapses() -> None:
    """Of who guesses in 5 %, F is (0.75 - 0.05) / 0.95 at the limit, whatever the lapses."""
    lapsing = replace(KNOWN, lapse_rate=0.1)
    function = PsychometricFunction(1.0, 1.6, 0.05, 0.1)
    ratios = np.array([0.0, 0.3, 0.9, 2.0])
    rise = (yes_probability(ratios, function) - 0.05) / (1 - 0.05 - 0.1)
    np.testing.assert_allclose(share_noticed(ratios, lapsing), rise)
    found = watched(lapsing, np.repeat(ratios, 50), np.tile(FRAMES, 4))
    assert found is not None
    assert (found.periods, found.assumed) == (4, "")
    assert found.noticed == pytest.approx(rise.mean())
    at_limit = watched(lapsing, np.ones(50), FRAMES)
    assert at_limit is not None
    assert at_limit.noticed == pytest.approx((0.75 - 0.05) / 0.95)


def test_of_two_intervals_it_is_what_is_told_beyond_chance() -> None:
    """75 % right are 50 % seen, and half of the others guessed right."""
    found = watched(replace(KNOWN, procedure=Procedure.TWO_INTERVAL, guess_rate=0.5), np.ones(50), FRAMES)
    assert found is not None
    assert found.noticed == pytest.approx(0.5)


def test_a_sensitive_person_notices_what_is_so_much_faster_for_them() -> None:
    """By hand: e^(1.645 · 0.3) times as fast, 2 ln 19 / 1.6 logits for each unit of ln(rate)."""
    found = watched(KNOWN, np.ones(50), FRAMES)
    assert found is not None
    logit = np.log((0.75 - 0.05) / 0.25) + stats.norm.ppf(0.95) * 0.3 * 2 * np.log(19) / 1.6
    assert found.noticed_sensitive == pytest.approx(1 / (1 + np.exp(-logit)))


def test_what_the_published_limit_does_not_tell_is_assumed_and_said() -> None:
    """The paper prints thresholds, but no slope and no false alarms."""
    found = watched(load_rate_limit("surace2025"), np.ones(50), FRAMES)
    assert found is not None
    assert found.noticed == pytest.approx(0.75)
    assert "width 1.6" in found.assumed
    assert watched(replace(KNOWN, ramp_duration=None), np.ones(9), np.ones(9)) is None


@pytest.mark.parametrize("form", RateLimitForm)
@pytest.mark.parametrize("share", [0.1, 0.25, 0.5, 0.9])
@pytest.mark.parametrize(("kind", "sds"), [(BandKind.POINTWISE, 1.0), (BandKind.SIMULTANEOUS, 4 / 3)])
def test_a_limit_moves_by_the_logistic_function(
    form: RateLimitForm, share: float, kind: BandKind, sds: float
) -> None:
    """ln(rate) moves by width / (2 ln 19) for each unit of logit F; F is (0.75 - g) / (1 - g) at 75 %."""
    first = 2.0 if form is RateLimitForm.RATE else np.log(2.0)
    limit = replace(KNOWN, form=form, coefficients=(first, 0.01), band_kind=kind)
    there, here = np.log(share / (1 - share)), np.log((0.75 - 0.05) / 0.25)
    slope = (there - here) / (2 * np.log(19))
    moved = limit_at_share(limit, share)
    places = np.array([3.0, 10.0, 40.0, 100.0, 300.0])
    np.testing.assert_allclose(moved(places), limit(places) * np.exp(1.6 * slope))
    assert float(share_noticed(1.0, moved)) == pytest.approx(share)
    assert f"noticed in {100 * share:g} % of the trials, beyond guesses" in moved.at_limit_in_words
    # Independent errors: the width's ends move the edges as the square root of the sum of squares, of as many
    # standard deviations as the band's: 2.6 of one that holds the whole curve, for 1.96.
    ends = sorted(np.array([1.28, 2.0]) * slope)
    curve = np.log(limit(np.array(limit.band_luminance)))
    edges = (moved.band_lower, limit.band_lower, ends[0]), (moved.band_upper, limit.band_upper, ends[1])
    for edge, was, end in edges:
        distance = np.hypot(np.log(was) - curve, sds * (end - 1.6 * slope))
        np.testing.assert_allclose(np.abs(np.log(edge) - curve - 1.6 * slope), distance)


def test_the_same_steps_are_noticed_as_often_whatever_the_share_of_the_limit() -> None:
    slow = limit_at_share(KNOWN, 0.25)
    ratio = float(KNOWN(50.0) / slow(50.0))
    usual = watched(KNOWN, np.full(50, 0.7), FRAMES)
    seen = watched(slow, np.full(50, 0.7 * ratio), FRAMES)
    assert usual is not None
    assert seen is not None
    assert (seen.noticed, seen.noticed_sensitive) == pytest.approx((usual.noticed, usual.noticed_sensitive))
    at_limit = watched(slow, np.ones(50), FRAMES)
    assert at_limit is not None
    assert at_limit.noticed == pytest.approx(0.25)


def test_three_quarters_leave_the_published_limit_as_it_is() -> None:
    published = load_rate_limit("surace2025")
    assert replace(limit_at_share(published, 0.75), noticed=None) == published


@pytest.mark.parametrize(
    ("share", "words"), [(0, "got 0"), (1, "got 1"), (75, "0.75 is 75 %"), ("50%", "number")]
)
def test_a_share_that_is_none_is_told_what_would_be(share: object, words: str) -> None:
    with pytest.raises(InputError, match=words):
        limit_at_share(KNOWN, share)
    with pytest.raises(InputError, match="for a share already"):
        limit_at_share(limit_at_share(KNOWN, 0.5), 0.5)


def test_a_file_of_an_earlier_version_is_read_and_has_the_same_hash() -> None:
    earlier = replace(KNOWN, width_range=None, participant_sd=None)
    content = mapping_from_record(earlier)
    for later in ("width_range", "participant_sd", "noticed"):
        del content[later]
    assert record_from_mapping(RateLimit, content, "limit.json") == earlier
    hashed = {key: value for key, value in content.items() if key != "display"}
    assert sha256_of_record(earlier) == sha256_of_bytes(json.dumps(hashed, sort_keys=True).encode())
    assert limit_at_share(earlier, 0.5).wide_band == ""  # of an assumed interval of the width
