"""Which displays count as calibrations of one, in which order, and when a limit holds for them."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import pytest

from evenlight.data_schema.display import Display
from evenlight.data_schema.mapping import mapping_from_record
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm
from evenlight.data_schema.recordings.display_calibrations import (
    calibrations_in_words,
    calibrations_of,
    require_joinable,
    why_apart,
)
from evenlight.data_schema.recordings.session import SessionManifest, SessionStatus

DESK = Display("desk", 100.0, 0.0, 2.2, 60.0)


def changed(**fields: Any) -> Display:
    return dataclasses.replace(DESK, **fields)


def session(participant: str, display: Display | None, started: str = "") -> SessionManifest:
    status = SessionStatus.COMPLETE
    return SessionManifest(
        participant, "01", "ramp", False, status, 3, display, None, Provenance(), started=started
    )


@pytest.mark.parametrize(
    "other",
    [
        changed(peak_luminance=96.0),
        changed(peak_luminance=124.0),
        changed(gamma=2.5),  # 0.5^0.3 = 0.81 of the gray's luminance: a factor of 1.23
        changed(pixels_per_degree=30.0),
        changed(name="the same panel by another name"),  # of the same photometry, which the limit goes by
    ],
    ids=lambda display: repr(display),
)
def test_calibrations_of_one_display_are_joined(other: Display) -> None:
    assert why_apart([session("01", DESK), session("02", other)]) == ""


@pytest.mark.parametrize(
    ("other", "words"),
    [
        (
            changed(name="tv", peak_luminance=99.0),
            "runs on the display 'tv', session 01 of participant 01 on",
        ),
        (changed(peak_luminance=126.0), "with 126 cd/m^2 at pixel value 1 and factor 1, session 01 of"),
        # 0.5^2.6 = 0.165 against 0.5^2.2 = 0.218: a factor of 1.32
        (
            changed(gamma=2.6),
            "at pixel value 0.5 and factor 1, session 01 of participant 01 with 21.76: a ratio",
        ),
        # A lamp: 0.2 x 21.76 = 4.353 and 3 more
        (changed(reflected_luminance=3.0), "with 7.353 cd/m^2 at pixel value 0.5 and factor 0.2, session 01"),
        (None, "has no display (manifest.json: display is null)"),
    ],
    ids=["name", "brightness", "gamma", "room", "unknown"],
)
def test_other_displays_are_told_with_session_values_and_the_way_out(
    other: Display | None, words: str
) -> None:
    said = why_apart([session("01", DESK), session("02", other)])
    assert said.startswith("session 01 of participant 02")
    assert words in said
    assert other is None or "in a data set of its own (`run`: another --out)" in said


def test_a_display_that_drifts_on_is_compared_with_all_before() -> None:
    """100, 90 and 79: neighbours are within 1.25 of each other, the ends are not (1.27)."""
    steps = [session(f"0{k}", changed(peak_luminance=peak)) for k, peak in enumerate((100.0, 90.0, 79.0))]
    assert why_apart(steps[:2]) == why_apart(steps[1:]) == ""
    assert "a ratio of 1.27" in why_apart(steps)


def test_one_calibration_under_two_names_is_measured_again_under_either() -> None:
    again = changed(name="tv", peak_luminance=96.0)
    both = [session("01", DESK), session("02", changed(name="tv"))]
    for last in (session("03", again), session("03", changed(peak_luminance=96.0))):
        assert why_apart([*both, last]) == why_apart([last, *both]) == ""
    assert "on 'desk': a rate limit holds for one display" in why_apart([both[0], session("03", again)])


def test_a_name_with_braces_is_shown_as_it_is() -> None:
    said = why_apart([session("01", DESK), session("02", changed(name="{x}", gamma=2.0))])
    assert "the display '{x}'" in said


def test_the_newest_calibration_is_the_last_measured() -> None:
    old, new = changed(measured="2026-01-01"), changed(peak_luminance=96.0, measured="2026-03-01T10:00:00")
    sessions = [session("01", new, "2026-03-02"), session("02", old, "2026-04-01"), session("03", new)]
    assert calibrations_of(sessions) == (old, new)
    said = calibrations_in_words(sessions)
    assert "100 cd/m^2, gamma 2.2, measured 2026-01-01, sessions: 1; 96 cd/m^2" in said
    assert "measured 2026-03-01, sessions: 2" in said
    assert calibrations_in_words(sessions[1:2]) == ""


def test_without_dates_the_newest_calibration_is_that_of_the_last_session() -> None:
    other = changed(peak_luminance=96.0)
    sessions = [session("01", other, "2026-03-02"), session("02", DESK, "2026-02-01")]
    assert calibrations_of(sessions) == (DESK, other)


def test_a_limit_holds_for_every_calibration_that_its_ramps_ran_on() -> None:
    new, third = changed(peak_luminance=96.0), changed(peak_luminance=95.0)
    prints = (DESK.fingerprint, new.fingerprint)
    limit = RateLimit("r", "desk", new.fingerprint, RateLimitForm.RATE, (2.0,), (10.0, 100.0))
    assert [limit.holds_for(display) for display in (DESK, new, third)] == [False, True, False]
    joined = dataclasses.replace(limit, display_fingerprints=prints)
    assert [joined.holds_for(display) for display in (DESK, new, third)] == [True, True, False]


@pytest.mark.parametrize(
    "trials",
    ["", '{"practice": true}\n', '{"practice": false, "flag": "dropped_frames"}\n', '{"practice": fal'],
    ids=["none", "practice", "flagged", "torn"],
)
def test_a_session_without_ramps_to_fit_stands_in_nobodys_way(tmp_path: Path, trials: str) -> None:
    """Begun on the wrong screen and stopped in practice: `fit` leaves it out, and `run` goes on."""
    folder = tmp_path / "sub-01/ses-01"
    folder.mkdir(parents=True)
    manifest = dataclasses.replace(session("01", changed(name="tv", gamma=2.0)), status=SessionStatus.ABORTED)
    (folder / "manifest.json").write_text(json.dumps(mapping_from_record(manifest)))
    (folder / "trials.jsonl").write_text(trials)
    assert require_joinable(tmp_path, session("02", DESK)) == ""
    (folder / "trials.jsonl").write_text('{"practice": false, "flag": ""}\n' + trials)
    with pytest.raises(ValueError, match="session 01 of participant 02 runs on the display 'desk', session"):
        require_joinable(tmp_path, session("02", DESK))
