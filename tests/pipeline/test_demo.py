"""`evenlight demo`: the loop is closed, and by files."""

import re
import shutil

import numpy as np
import pytest
from browser_pages import browser_session
from PIL import Image
from report_pages import faults_at

from evenlight import command as command_line
from evenlight.analysis.tracks.first_page import first_page
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import sha256_of_record
from evenlight.data_schema.provenance import sha256_of_file
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.storage.tables import read_rows
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.data_schema.threshold import Threshold
from evenlight.data_schema.tracks.brightness_track import read_track
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary
from evenlight.method.rate_limit import rate_limit_at
from evenlight.stimuli.sequences import built_in_sequence


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Of a smaller sunrise than the command's own, which the commands of the README make."""
    out = tmp_path_factory.mktemp("demo") / "out"
    small = built_in_sequence("sunrise", size=(96, 54), duration=40.0, frames_per_second=2.5)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("evenlight.stimuli.sequences.built_in_sequence", lambda name, **_: small)
        with pytest.raises(SystemExit) as ended:
            command_line.main(["demo", "--out", str(out), "--participants", "4", "--seed", "3", "--quiet"])
    assert not ended.value.code
    return out


def limit_and_summary(folder):
    limit = read_json_record(RateLimit, folder / "calibration" / "rate_limit.json")
    return limit, read_json_record(OptimizationSummary, folder / "track" / "summary.json")


def test_the_rate_limit_that_was_fitted_is_the_one_the_optimizer_used(folder) -> None:
    limit, summary = limit_and_summary(folder)
    assert summary.provenance.inputs["rate_limit"] == sha256_of_record(limit)
    track = read_track(folder / "track" / "track.csv")
    at_ends = rate_limit_at(limit, track.mean_luminance)
    np.testing.assert_allclose(track.rate_limit[:-1], np.minimum(at_ends[:-1], at_ends[1:]), rtol=1e-6)
    assert (np.abs(track.rate) <= track.rate_limit * (1 + 1e-6)).all()


def test_the_rate_limit_comes_from_the_data_set_beside_it(folder) -> None:
    limit, _ = limit_and_summary(folder)
    assert limit.simulated
    assert limit.provenance is not None
    assert len(read_rows(Threshold, folder / "calibration" / "thresholds.csv")) == 4 * 10
    assert limit.provenance.inputs["dataset"]


def test_the_track_is_calm_and_says_how_detectable_it_is_by_the_calibration(folder) -> None:
    limit, summary = limit_and_summary(folder)
    assert summary.calm == 0.05
    assert summary.share_at_limit < 0.05
    # One window for each ramp's duration; a change in all of them would be "yes" in at most 75 %.
    seen = summary.watched
    assert seen.periods == round(summary.duration / limit.ramp_duration)
    assert 0 < seen.noticed < min(0.75, seen.noticed_sensitive)
    assert seen.assumed == ""


def test_the_track_is_better_than_constant_dimming_at_equal_power(folder) -> None:
    _, summary = limit_and_summary(folder)
    assert summary.achieved == pytest.approx(summary.budget, abs=1e-6)
    assert summary.mean_power == pytest.approx(summary.baseline_power, rel=1e-6)
    assert summary.objective < summary.objective_baseline
    # A bound above the objective ends the command; what a good one adds is that it is not far below.
    assert summary.lower_bound > 0.5 * summary.objective


def test_the_sun_gets_less_light_than_the_night(folder) -> None:
    factors = read_track(folder / "track" / "track.csv").factors
    n = len(factors)
    assert factors[: n // 10].mean() > factors[4 * n // 10 : 6 * n // 10].mean() + 0.05
    assert factors[-n // 10 :].mean() > factors[4 * n // 10 : 6 * n // 10].mean() + 0.05


def test_the_report_needs_nothing_but_itself_and_says_what_is_simulated(folder) -> None:
    html = (folder / "report.html").read_text()
    assert set(re.findall(r'(?:src|href)="(?!data:|#)([^"]*)', html)) == {"track/player.html"}  # a link
    assert not re.search(r'(src|href)="(?!data:|#)', (folder / "track" / "player.html").read_text())
    assert "simulated participants" in html
    for name in ("psychometric.png", "rate_limit.png"):
        darkest, brightest = Image.open(folder / "calibration" / name).convert("L").getextrema()
        assert brightest - darkest > 100


def test_everything_validates(folder, command) -> None:
    assert command("validate", folder / "dataset").code == 0
    assert command("validate", folder / "calibration").code == 0
    assert command("validate", folder / "track").code == 0


def test_a_second_demo_may_take_the_place_of_the_first(folder, monkeypatch, capsys) -> None:
    """Of a smaller video: what is shown of the first is in the tests above."""
    shorter = built_in_sequence("sunrise", size=(64, 36), duration=4.0, frames_per_second=5.0)
    monkeypatch.setattr("evenlight.stimuli.sequences.built_in_sequence", lambda name, **_: shorter)
    before = sha256_of_file(folder / "calibration" / "thresholds.csv")
    with pytest.raises(SystemExit) as ended:
        command_line.main(["demo", "--out", str(folder), "--participants", "2", "--seed", "3"])
    assert not ended.value.code
    assert capsys.readouterr().out.splitlines()[:-1] == [*first_page(limit_and_summary(folder)[1])]
    assert sha256_of_file(folder / "calibration" / "thresholds.csv") != before
    assert len(list((folder / "dataset").glob("sub-*"))) == 2


def test_a_demo_never_touches_recorded_data(command, tmp_path) -> None:
    recorded = tmp_path / "dataset" / "sub-01" / "ses-01" / "trials.jsonl"
    recorded.parent.mkdir(parents=True)
    recorded.write_text("precious")
    result = command("demo", "--out", tmp_path)
    assert result.code == 2
    assert "other things than a result of `evenlight demo`: dataset/sub-01" in result.err
    assert recorded.read_text() == "precious"


def test_a_demo_never_replaces_simulated_data_that_somebody_else_keeps(command, folder, tmp_path) -> None:
    kept = tmp_path / "dataset"
    assert command("simulate", "ramp", "--participants", 1, "--out", kept, "--quiet").code == 0
    before = sha256_of_file(kept)
    assert "other things than a result of `evenlight demo`" in command("demo", "--out", tmp_path).err
    assert sha256_of_file(kept) == before


def test_a_demo_never_replaces_its_data_set_when_somebody_wrote_into_it(command, folder, tmp_path) -> None:
    again = tmp_path / "again"
    shutil.copytree(folder, again)
    (again / "dataset" / "sub-99").mkdir()
    (again / "dataset" / "sub-99" / "trials.jsonl").write_text("precious")
    assert "demo`: dataset/sub-99/trials.jsonl; " in command("demo", "--out", again).err
    assert (again / "dataset" / "sub-99" / "trials.jsonl").read_text() == "precious"


def test_a_second_demo_that_fails_leaves_the_first_as_it_was(command, folder, tmp_path, monkeypatch) -> None:
    again = tmp_path / "again"
    shutil.copytree(folder, again)

    def fail(*given: object) -> None:
        raise InputError("the disk is full")

    monkeypatch.setattr("evenlight.analysis.tracks.closed_loop.close_loop", fail)
    before = sha256_of_file(again)
    result = command("demo", "--out", again, "--participants", 2, "--quiet")
    assert (result.code, result.err) == (2, "evenlight: the disk is full\n")
    assert sha256_of_file(again) == before


def test_a_demo_with_an_impossible_budget_leaves_nothing(command, tmp_path) -> None:
    result = command("demo", "--out", tmp_path / "out", "--budget", 0.1)
    assert result.code == 2
    assert not (tmp_path / "out").exists()


def test_the_report_fits_the_screen(folder) -> None:
    with browser_session() as browser:
        browser.open(folder / "report.html")
        assert [fault for width in (1100, 360) for fault in faults_at(browser, width)] == []
        assert browser.errors() == []
