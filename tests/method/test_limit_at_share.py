"""A rate limit for another share of detections: moved by the psychometric function, its band widened."""

import json
from dataclasses import replace

import numpy as np
import pytest

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import mapping_from_record, record_from_mapping, sha256_of_record
from evenlight.data_schema.provenance import sha256_of_bytes
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm
from evenlight.data_schema.recordings.ramp import Procedure
from evenlight.method.detectability import function_of, limit_at_share, watched
from evenlight.method.preset_files import load_rate_limit
from evenlight.method.psychometric import yes_probability

BANDED = RateLimit(
    "lab", "d", "", RateLimitForm.RATE, (2.0,), (10.0, 100.0), procedure=Procedure.YES_NO, ramp_duration=5.0,
    width=1.6, guess_rate=0.05, lapse_rate=0.0, width_range=(1.28, 2.0), participant_sd=0.3,
    band_luminance=(10.0, 100.0), band_lower=(1.6, 1.5), band_upper=(2.5, 2.8),
)  # fmt: skip


@pytest.mark.parametrize("form", RateLimitForm)
@pytest.mark.parametrize("share", [0.1, 0.25, 0.5, 0.9])
def test_a_limit_moves_by_the_logistic_function(form: RateLimitForm, share: float) -> None:
    """ln(rate) moves by width / (2 ln 19) for each unit of logit F; F is (0.75 - g) / (1 - g) at 75 %."""
    first = 2.0 if form is RateLimitForm.RATE else np.log(2.0)
    limit = replace(BANDED, form=form, coefficients=(first, 0.01))
    there, here = np.log(share / (1 - share)), np.log((0.75 - 0.05) / 0.25)
    slope = (there - here) / (2 * np.log(19))
    moved = limit_at_share(limit, share)
    places = np.array([3.0, 10.0, 40.0, 100.0, 300.0])
    np.testing.assert_allclose(moved(places), limit(places) * np.exp(1.6 * slope))
    function = function_of(moved)
    assert function is not None
    assert float(yes_probability(1.0, function)) == pytest.approx(0.05 + 0.95 * share)
    assert f"noticed in {100 * share:g} % of the trials, beyond guesses" in moved.at_limit_in_words
    # Independent errors: the width's ends move the edges as the square root of the sum of squares.
    ends = sorted(np.array([1.28, 2.0]) * slope)
    curve = np.log(limit(np.array(limit.band_luminance)))
    edges = (moved.band_lower, limit.band_lower, ends[0]), (moved.band_upper, limit.band_upper, ends[1])
    for edge, was, end in edges:
        distance = np.hypot(np.log(was) - curve, end - 1.6 * slope)
        np.testing.assert_allclose(np.abs(np.log(edge) - curve - 1.6 * slope), distance)


def test_the_same_steps_are_noticed_as_often_whatever_the_share_of_the_limit() -> None:
    slow = limit_at_share(BANDED, 0.25)
    ratio = float(BANDED(50.0) / slow(50.0))
    usual = watched(BANDED, np.full(50, 0.7), np.full(50, 0.1))
    seen = watched(slow, np.full(50, 0.7 * ratio), np.full(50, 0.1))
    assert usual is not None
    assert seen is not None
    assert (seen.noticed, seen.d_prime) == pytest.approx((usual.noticed, usual.d_prime))
    at_limit = watched(slow, np.ones(50), np.full(50, 0.1))
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
        limit_at_share(BANDED, share)
    with pytest.raises(InputError, match="for a share already"):
        limit_at_share(limit_at_share(BANDED, 0.5), 0.5)


def test_a_file_of_an_earlier_version_is_read_and_has_the_same_hash() -> None:
    earlier = replace(BANDED, width_range=None, participant_sd=None)
    content = mapping_from_record(earlier)
    for later in ("width_range", "participant_sd", "noticed"):
        del content[later]
    assert record_from_mapping(RateLimit, content, "limit.json") == earlier
    hashed = {key: value for key, value in content.items() if key != "display"}
    assert sha256_of_record(earlier) == sha256_of_bytes(json.dumps(hashed, sort_keys=True).encode())
    assert limit_at_share(earlier, 0.5).wide_band == ""  # of an assumed interval of the width
