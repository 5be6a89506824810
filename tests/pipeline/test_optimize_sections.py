"""`evenlight optimize` with sections of weights and allowances, several clips, and an earlier track."""

import json
from itertools import combinations

import numpy as np
import pytest

from evenlight.data_schema.provenance import sha256_of_bytes
from evenlight.data_schema.tracks.brightness_track import read_sections, read_track

pytestmark = pytest.mark.usefixtures("blank_pictures")


@pytest.fixture
def videos(tmp_path, make_video):
    paths = [tmp_path / "a.mkv", tmp_path / "b.mkv"]
    make_video(paths[0], np.linspace(0.2, 0.8, 10), (32, 24), 2.0)
    make_video(paths[1], np.linspace(0.9, 0.3, 8), (32, 24), 2.0)
    return paths


def test_weights_and_allowances_are_kept_and_named_in_the_summary(command, tmp_path, videos) -> None:
    weights, allowances = tmp_path / "v.weights.csv", tmp_path / "v.allowances.csv"
    weights.write_text("start_s,end_s,weight\n0,2,3\n4,5,0\n")
    allowances.write_text("start_s,end_s,allowance\n1,2.1,0\n3,3.5,20\n")
    out = tmp_path / "out"
    options = ("--weights", weights, "--allowances", allowances, "--budget", 0.5, "--quiet")
    assert command("optimize", "--no-player", videos[0], *options, "--out", out).code == 0
    summary = json.loads((out / "summary.json").read_text())
    inputs = summary["provenance"]["inputs"]
    assert inputs["weights"] == sha256_of_bytes(weights.read_bytes())
    assert inputs["allowances"] == sha256_of_bytes(allowances.read_bytes())
    track = read_track(out / "track.csv")
    assert np.ptp(track.factors[1:5]) == 0  # the steps to the frames at 1, 1.5 and 2 s
    assert (track.rate_limit[1:4] == 0).all()
    assert summary["max_rate_ratio"] <= 1 + 1e-6
    assert summary["weighted"] is True
    assert summary["largest_allowance"] == 20
    moving = track.rate_limit[:-1] > 0
    fitted = np.where(track.times[1:] == 3.0, track.rate_limit[:-1] / 20, track.rate_limit[:-1])
    ratio = (np.abs(track.rate[:-1])[moving] / fitted[moving]).max()
    assert summary["max_rate_ratio_fitted"] == pytest.approx(ratio, rel=1e-12)
    checked = command("validate", tmp_path)
    assert checked.code == 0, checked.out
    one = tmp_path / "one.csv"  # table for both: an empty cell is as outside all sections
    one.write_text("start_s,end_s,weight,allowance\n0,1,3,\n1,2,3,0\n2,2.1,,0\n3,3.5,,20\n4,5,0,\n")
    both = tmp_path / "both"
    options = ("--weights", one, "--allowances", one, "--budget", 0.5, "--quiet")
    assert command("optimize", "--no-player", videos[0], *options, "--out", both).code == 0
    assert (both / "track.csv").read_bytes() == (out / "track.csv").read_bytes()


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_sections_of_a_spreadsheet_with_decimal_commas_are_read(tmp_path, end) -> None:
    """The case reported: Excel's weights were an unknown column 'start_s;end_s;weight'."""
    table = tmp_path / "v.weights.csv"
    table.write_bytes(end.join(["start_s;end_s;weight", "0;1,5;3", "1,5;2,25;0,5", ""]).encode())
    first, second = read_sections(table, "weight")
    assert (first.start, first.end, first.weight) == (0.0, 1.5, 3.0)
    assert (second.start, second.end, second.weight) == (1.5, 2.25, 0.5)


def test_sections_that_overlap_are_named_with_their_lines_at_once(command, tmp_path, videos) -> None:
    """By more than a millisecond: times may be rounded."""
    table, out = tmp_path / "v.weights.csv", tmp_path / "out"
    table.write_text("start_s,end_s,weight\n3,4,1\n\n0,1.0004,3\n1,3.5,2\n")
    refused = command("optimize", videos[0], "--weights", table, "--budget", 0.5, "--out", out)
    assert refused.code == 2
    assert refused.err == (
        f"evenlight: {table}, line 2: the section from 3 to 4 s overlaps that of line 5, from 1 to 3.5 s; "
        "give each frame one section\n"
    )


def test_clips_share_a_budget_and_get_folders_of_their_own(command, tmp_path, videos, monkeypatch) -> None:
    out = tmp_path / "out"
    exact = ("--budget", 0.5, "--calm", 0, "--quiet")
    done = command("optimize", "--no-player", videos[0], "--with", videos[1], *exact, "--out", out)
    assert done.code == 0, done.err
    tracks = [read_track(out / name / "track.csv") for name in ("01-a", "02-b")]
    assert [len(track.factors) for track in tracks] == [10, 8]
    factors = np.concatenate([track.factors for track in tracks])
    assert np.mean(factors) == pytest.approx(0.5, abs=1e-6)
    assert all((np.abs(t.rate) <= t.rate_limit * (1 + 1e-6)).all() for t in tracks)
    whole = json.loads((out / "summary.json").read_text())
    assert whole["frames"] == 18
    for name, track in zip(("01-a", "02-b"), tracks, strict=True):
        own = json.loads((out / name / "summary.json").read_text())
        assert (own["frames"], own["clips"], own["budget"]) == (len(track.factors), 2, 0.5)
        assert own["achieved"] == pytest.approx(track.factors.mean(), rel=1e-12)
        assert own["baseline_factor"] == pytest.approx(own["mean_factor"], rel=1e-12)
        assert own["baseline_power_w"] == pytest.approx(own["mean_power_w"], rel=1e-9)
        assert own["lower_bound"] == 0  # that of all clips is none of one
    assert command("validate", out).code == 0
    monkeypatch.setattr("evenlight.analysis.tracks.track_results._draw", lambda *_: None)
    again = ("--start", out, *exact, "--out", tmp_path / "again")
    assert command("optimize", "--no-player", videos[0], "--with", videos[1], *again).code == 0
    repeated = json.loads((tmp_path / "again" / "summary.json").read_text())
    assert repeated["objective"] <= whole["objective"] + 1e-6
    both = b"".join((out / name / "track.csv").read_bytes() for name in ("01-a", "02-b"))
    assert repeated["provenance"]["inputs"]["start"] == sha256_of_bytes(both)
    failed = command("optimize", "--no-player", videos[0], *again)
    assert failed.code == 2
    assert "holds 2 tracks, asked is an optimization of 1 video" in failed.err


def test_a_clip_of_no_weight_has_figures_of_its_own(command, tmp_path, videos, monkeypatch) -> None:
    drawn: list[bool] = []
    monkeypatch.setattr(
        "evenlight.analysis.tracks.track_results._draw", lambda *given: drawn.append(given[0].counts)
    )
    weights, out = tmp_path / "v.weights.csv", tmp_path / "out"
    weights.write_text("start_s,end_s,weight\n5,9,0\n")  # all of the second clip
    options = ("--with", videos[1], "--weights", weights, "--budget", 0.6, "--out", out)
    done = command("optimize", "--no-player", videos[0], *options)
    assert done.code == 0, done.err
    assert "by their weights" in done.out
    own = json.loads((out / "02-b" / "summary.json").read_text())
    loss = read_track(out / "02-b" / "track.csv").contrast_loss
    pairs = [abs(a - b) for a, b in combinations(loss, 2)]
    assert own["objective"] == pytest.approx(np.mean(pairs), rel=1e-9)
    assert own["objective"] > 0
    assert own["weighted"] is False
    assert drawn == [True, False]


def test_an_earlier_track_may_be_the_start(command, tmp_path, videos) -> None:
    first, again = tmp_path / "first", tmp_path / "again"
    assert command("optimize", "--no-player", videos[0], "--budget", 0.5, "--out", first, "--quiet").code == 0
    options = ("--budget", 0.52, "--start", first, "--quiet")
    assert command("optimize", "--no-player", videos[0], *options, "--out", again).code == 0
    summary = json.loads((again / "summary.json").read_text())
    assert summary["provenance"]["inputs"]["start"] == sha256_of_bytes((first / "track.csv").read_bytes())
    assert summary["mean_factor"] == pytest.approx(0.52, abs=1e-6)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("start_s,end_s,weight\n2,1,3\n", "need start_s < end_s, got 2 and 1"),
        ("start_s,end_s,weight\n0,1,-3\n", "weight"),
        ("start_s,end_s,weight\n90,91,3\n", "holds no frame"),
        ("start,end,weight\n0,1,3\n", "start_s"),
        ("start_s,end_s,allowance\n0,1,3\n", "w.csv: says no weight; give a csv table start_s,end_s,weight"),
    ],
)
def test_bad_sections_end_with_one_line(command, tmp_path, videos, text, says) -> None:
    file = tmp_path / "w.csv"
    file.write_text(text)
    out = tmp_path / "out"
    failed = command(
        "optimize", "--no-player", videos[0], "--budget", 0.5, "--weights", file, "--out", out, "--quiet"
    )
    assert failed.code == 2
    assert says in failed.err
    assert failed.err.strip().count("\n") == 0
    assert not out.exists()
