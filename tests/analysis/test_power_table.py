"""Claims about the power table of a played video: right numbers, named doubts, clear refusals."""

from __future__ import annotations

import dataclasses
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from played_power_truth import Conditions, Truth, chosen, play, write_folder

from evenlight.analysis.played_power.power_recording import _columns, load_recording
from evenlight.analysis.played_power.power_report import measure_power, write_power_results
from evenlight.analysis.played_power.power_views import MeasuredPower, _binned
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.power_model import PanelKind, PowerModel
from evenlight.data_schema.recordings.played_power import (
    ClockMethod,
    FrameEnergy,
    FrameFlag,
    PlayedPower,
)
from evenlight.data_schema.storage.tables import read_rows
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.method.preset_files import load_power_model

SHORT = Conditions(frames=60, sample_rate=500.0, content="ramps", passes=("ours", "baseline", "full") * 2)
VERSIONS = ("baseline", "ours", "full")


def known(conditions: Conditions = SHORT, seed: int = 1) -> Truth:
    return play(conditions, np.random.default_rng(seed))


@pytest.fixture(scope="module")
def truth() -> Truth:
    return known()


@pytest.fixture(scope="module")
def results(truth: Truth, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    folder = write_folder(truth, tmp_path_factory.mktemp("played"))
    return folder, write_power_results(folder, folder, load_power_model("surace2025"))


@pytest.fixture(scope="module")
def three_passes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    played = dataclasses.replace(SHORT, passes=("ours", "baseline", "full"), sample_rate=250.0)
    return write_folder(known(played), tmp_path_factory.mktemp("three"))


@pytest.fixture
def folder(three_passes: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(three_passes, tmp_path / "played"))


def until(truth: Truth, keep: Callable[[np.ndarray], np.ndarray]) -> MeasuredPower:
    """What is measured if the meter samples only while a function of the computer's time is true."""
    samples = truth.recording.samples
    some = chosen(samples, keep(truth.to_computer(samples.device_time)))
    return measure_power(dataclasses.replace(truth.recording, samples=some))


def test_mean_powers_are_those_of_the_truth(truth: Truth) -> None:
    power, flips = measure_power(truth.recording).power, truth.recording.flips
    for one in power.passes:
        times = flips.flip[flips.pass_index == one.pass_index]
        begun, ended = times[0], times[-1] + 1 / 60
        true = float(truth.energy(ended) - truth.energy(begun)) / (ended - begun)
        assert one.mean_power == pytest.approx(true, rel=1e-4)
    assert [one.version for one in power.versions] == list(VERSIONS)
    assert power.clock.method is ClockMethod.EDGES


def test_every_file_is_written_and_read_back(results: tuple[Path, list[str]]) -> None:
    folder, lines = results
    power = read_json_record(PlayedPower, folder / "played_power.json")
    frames = read_rows(FrameEnergy, folder / "frame_energy.csv")
    assert len(frames) == 6 * 60
    assert (folder / "power.png").read_bytes().startswith(b"\x89PNG")
    assert set(power.provenance.inputs) >= {"power.csv", "flips.csv", "clock.csv", "power_log.json"}
    assert str(folder / "report.html") in lines[-1]


def test_simulated_power_is_called_so_everywhere(results: tuple[Path, list[str]]) -> None:
    folder, lines = results
    assert lines[0].startswith("SIMULATED")
    assert read_json_record(PlayedPower, folder / "played_power.json").simulated
    page = (folder / "report.html").read_text()
    assert "Simulated: the power meter, the panel or both are simulated" in page
    assert "simulated participants" not in page


def test_the_report_needs_no_other_file_and_shows_the_table(results: tuple[Path, list[str]]) -> None:
    folder, _ = results
    page = (folder / "report.html").read_text()
    assert not re.search(r'(src|href)="(?!data:|#)', page)
    power = read_json_record(PlayedPower, folder / "played_power.json")
    for one in power.versions:
        assert f"{one.mean_power:.4f}" in page
    for note in power.notes:
        assert note.split("'")[0][:40] in page


def test_what_is_saved_is_said_with_its_interval(results: tuple[Path, list[str]]) -> None:
    _, lines = results
    assert re.search(
        r"the track saves \d\.\d+ W against full brightness, \d+\.\d+ % \(95 % confidence interval", lines[1]
    )
    assert re.match(r"the track takes 0\.\d+ W, as with constant dimming: difference ", lines[2])


def test_from_python_it_answers_as_every_analysis(truth: Truth) -> None:
    measured = measure_power(truth.recording)
    assert measured.to_frame()["version"].tolist() == list(VERSIONS)
    assert list(measured.figures) == ["power"]
    assert repr(measured).startswith("<Simulated power of simulated clip>\nThe track saves 0.8")
    assert len(measured.first_lines[0].split()) <= 60
    assert [card.what for card in measured.first_lines[1]] == [
        "the track",
        "saved against full brightness",
        "the track less constant dimming",
        "passes count",
    ]


def test_an_lcds_model_predicts_from_the_mean_factor(truth: Truth) -> None:
    """The simulated panel has the line of the preset: both agree, but for its lag and the dark before."""
    measured = measure_power(truth.recording, load_power_model("surace2025")).power
    for one in measured.versions:
        assert one.predicted_power == pytest.approx(0.2945 + 0.001858 * 750 * one.mean_factor, rel=1e-3)
        assert one.predicted_power == pytest.approx(one.mean_power, rel=0.01)


def test_a_model_of_another_panel_is_named(truth: Truth) -> None:
    """Twice as steep and twice the base: everything measured is half of what it predicts."""
    twice = PowerModel("another", PanelKind.LCD, 0.589, power_per_luminance=0.003716, peak_luminance=750.0)
    notes = measure_power(truth.recording, twice).power.notes
    assert any(
        re.match(r"What was measured is (49|50) to 50 % of what .* another predicts", n) for n in notes
    )


def test_an_oleds_model_predicts_nothing_without_the_content_and_it_is_said(truth: Truth) -> None:
    oled = PowerModel("a phone", PanelKind.OLED, 0.3, red_power=0.5, green_power=0.5, blue_power=0.8)
    power = measure_power(truth.recording, oled).power
    assert all(one.predicted_power is None for one in power.versions)
    assert any("a phone is of an OLED panel" in note for note in power.notes)


def test_a_meter_that_stopped_early_leaves_out_the_passes_that_it_missed(truth: Truth) -> None:
    flips = truth.recording.flips
    stop = flips.flip[flips.pass_index == 4][30]
    power = until(truth, lambda when: when < stop).power
    assert [one.used for one in power.passes] == [True, True, True, True, False, False]
    assert power.passes[4].measured_share == pytest.approx(0.5, abs=0.05)
    assert power.passes[5].mean_power is None
    assert any("Pass 5 (baseline) does not count" in note for note in power.notes)
    assert any("were shown while the meter did not sample" in note for note in power.notes)


def test_samples_that_end_just_before_the_video_does_cost_its_last_frames_only(truth: Truth) -> None:
    stop = truth.recording.flips.flip[-2] + 0.005
    measured = until(truth, lambda when: when < stop)
    assert [frame.flag for frame in measured.energies[-3:]] == [
        FrameFlag.OK,
        FrameFlag.OUTSIDE,
        FrameFlag.OUTSIDE,
    ]
    assert measured.power.passes[-1].used


def test_a_gap_in_the_middle_costs_its_frames_only(truth: Truth) -> None:
    flips = truth.recording.flips
    begun = flips.flip[flips.pass_index == 1][20]
    measured = until(truth, lambda when: (when < begun) | (when > begun + 0.1))
    lost = [frame for frame in measured.energies if frame.flag is FrameFlag.GAP]
    assert 6 <= len(lost) <= 8  # 0.1 s are six frames, and the gap begins and ends within one
    assert measured.power.samples.longest_gap == pytest.approx(0.1, abs=0.01)
    assert not measured.power.passes[1].used  # of a second, 0.1 s is more than the 5 % that may be missing


def test_a_meter_that_missed_everything_is_refused_with_its_file(truth: Truth) -> None:
    begun = truth.recording.flips.flip[0]
    with pytest.raises(InputError, match=r"power\.csv: no pass has power for 95 % of the video .at most 0 %"):
        until(truth, lambda when: when < begun)


def test_one_pass_of_each_has_no_interval_and_no_test() -> None:
    power = measure_power(
        known(dataclasses.replace(SHORT, passes=("ours", "baseline", "full"))).recording
    ).power
    assert all(one.ci_low is None and one.sd_power is None for one in power.versions)
    assert power.equal_power is not None
    assert power.equal_power.equal is None
    assert any(note.startswith("One pass of a version says nothing") for note in power.notes)


def test_a_version_that_was_not_played_is_named() -> None:
    power = measure_power(known(dataclasses.replace(SHORT, passes=("ours", "baseline"))).recording).power
    assert [one.version for one in power.versions] == ["baseline", "ours"]
    assert all(one.saving is None for one in power.versions)
    assert "Full brightness was not measured." in power.notes


def test_passes_that_were_not_played_are_named(truth: Truth) -> None:
    log = dataclasses.replace(truth.recording.log, passes=(*SHORT.passes, "ours"))
    power = measure_power(dataclasses.replace(truth.recording, log=log)).power
    assert "1 of 7 passes were not played." in power.notes


def test_a_video_of_one_frame_has_a_power(tmp_path: Path) -> None:
    truth = known(dataclasses.replace(SHORT, frames=1))
    lines = write_power_results(write_folder(truth, tmp_path), tmp_path)
    power = read_json_record(PlayedPower, tmp_path / "played_power.json")
    assert [one.n_frames for one in power.passes] == [1] * 6
    assert lines


def test_dropped_refreshes_are_counted_and_their_frames_last_longer() -> None:
    truth = known(dataclasses.replace(SHORT, dropped=0.1))
    power = measure_power(truth.recording).power
    shown = sum(one.n_frames for one in power.passes)
    dropped = sum(one.n_dropped for one in power.passes)
    at_end = (
        6 * 60 - shown - dropped
    )  # a refresh that fails at the very end of a pass is not missed by any flip
    assert dropped > 20
    assert 0 <= at_end <= 6
    assert any(f"{dropped} refreshes of the display were dropped" in note for note in power.notes)
    assert power.versions[1].mean_power == pytest.approx(
        measure_power(known().recording).power.versions[1].mean_power, rel=0.02
    )


def test_a_meter_slower_than_frames_still_tells_the_average() -> None:
    truth = known(dataclasses.replace(SHORT, sample_rate=25.0, frames=300, passes=("ours", "full")))
    measured = measure_power(truth.recording)
    assert all(frame.flag is not FrameFlag.OK for frame in measured.energies)
    assert any(note.startswith("The meter samples more slowly") for note in measured.power.notes)
    flips = truth.recording.flips
    for one in measured.power.passes:
        begun, ended = (flips.flip[flips.pass_index == one.pass_index][k] for k in (0, -1))
        true = float(truth.energy(ended) - truth.energy(begun)) / (ended - begun)
        assert one.mean_power == pytest.approx(true, rel=0.01)


# Folders that contradict themselves


def edit(path: Path, change: Callable[[list[str]], list[str]]) -> None:
    path.write_text("\n".join(change(path.read_text().splitlines())) + "\n")


def swapped(lines: list[str], row: int) -> list[str]:
    return [*lines[:row], lines[row + 1], lines[row], *lines[row + 2 :]]


def with_cell(lines: list[str], row: int, column: str, value: str) -> list[str]:
    cells = lines[row].split(",")
    cells[lines[0].split(",").index(column)] = value
    return [*lines[:row], ",".join(cells), *lines[row + 1 :]]


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("flips.csv", lambda rows: swapped(rows, 10), r"flips.csv, line 12: flip_s .* is not after"),
        ("flips.csv", lambda rows: [*rows[:11], rows[10], *rows[11:]], r"flips.csv, line 12: flip_s"),
        ("flips.csv", lambda rows: with_cell(rows, 10, "video_frame", "3"), "frame 3 comes after 8"),
        ("flips.csv", lambda rows: with_cell(rows, 100, "pass_index", "0"), "pass 0 comes after 1"),
        ("flips.csv", lambda rows: with_cell(rows, 10, "version", "full"), "pass 0 is 'full', but 'ours'"),
        ("flips.csv", lambda rows: with_cell(rows, 180, "pass_index", "7"), "but 'no such pass' in"),
        ("flips.csv", lambda rows: rows[:1], "flips.csv: holds no flip"),
        ("power.csv", lambda rows: with_cell(rows, 10, "power_w", "nan"), "line 11: power_w: expected a"),
        ("power.csv", lambda rows: with_cell(rows, 10, "power_w", ""), "line 11: power_w: expected a"),
        ("power.csv", lambda rows: with_cell(rows, 10, "sequence", "1.5"), "line 11: sequence: expected a"),
        ("power.csv", lambda rows: with_cell(rows, 10, "sequence", "-1"), "line 11: sequence must be at"),
        ("power.csv", lambda rows: with_cell(rows, 10, "sequence", "1e300"), "line 11: sequence: expected a"),
        ("power.csv", lambda rows: with_cell(rows, 10, "device_time_s", "0.0"), "line 11: device_time_s"),
        ("power.csv", lambda rows: [*rows[:9], rows[9] + ",1", *rows[10:]], "line 10: expected 5 cells"),
        ("power.csv", lambda rows: [rows[0].replace("power_w", "watt"), *rows[1:]], "column 'watt'"),
        ("power.csv", lambda rows: rows[:1], r"power.csv: holds 0 sample\(s\)"),
        ("power.csv", lambda rows: [], "power.csv: is empty"),
        ("flashes.csv", lambda rows: swapped(rows, 3), "flashes.csv, line 5: time_s"),
        ("clock.csv", lambda rows: with_cell(rows, 2, "received_s", "0.0"), "clock.csv, line 3: need sent"),
    ],
)
def test_a_folder_that_contradicts_itself_is_refused_with_file_and_line(
    folder: Path, name: str, change: Callable[[list[str]], list[str]], words: str
) -> None:
    edit(folder / name, change)
    before = sorted(path.name for path in folder.iterdir())
    with pytest.raises(InputError, match=words):
        write_power_results(folder, folder)
    assert sorted(path.name for path in folder.iterdir()) == before


@pytest.mark.parametrize("name", ["power_log.json", "power.csv", "flips.csv"])
def test_a_file_that_is_missing_is_named(folder: Path, name: str) -> None:
    (folder / name).unlink()
    with pytest.raises(InputError, match=f"{name}: no such file"):
        write_power_results(folder, folder)


def test_pings_and_markers_may_be_missing(folder: Path) -> None:
    (folder / "clock.csv").unlink()
    (folder / "flashes.csv").unlink()
    assert measure_power(load_recording(folder)).power.clock.method is ClockMethod.EDGES


def test_a_table_is_read_the_same_by_columns_and_row_by_row(folder: Path) -> None:
    """An empty cell, which stands for no synchronisation, is nothing that columns of plain values have."""
    path = folder / "power.csv"
    quick = load_recording(folder).samples
    row = int(np.flatnonzero(~quick.sync)[5])
    edit(path, lambda lines: with_cell(lines, row + 1, "sync", ""))
    assert _columns(path) is None
    slow = load_recording(folder).samples
    assert not slow.sync[row]
    for name in ("sequence", "device_time", "received", "power", "sync"):
        assert getattr(quick, name) == pytest.approx(getattr(slow, name), rel=1e-14)  # the last digit


def test_samples_without_a_synchronisation_column_have_no_edges(folder: Path) -> None:
    edit(folder / "power.csv", lambda lines: [line.rpartition(",")[0] for line in lines])
    recording = load_recording(folder)
    assert not recording.samples.sync.any()
    assert measure_power(recording).power.clock.method is ClockMethod.PINGS


def test_the_line_of_the_figure_is_the_mean_power_and_broken_where_there_is_none() -> None:
    """Frames of 1 s: 2 J, left out, 4 J, and a rest too short to tell; two points to each."""

    def frame(begun: float, lasts: float, energy: float | None) -> FrameEnergy:
        flag = FrameFlag.GAP if energy is None else FrameFlag.OK
        power = None if energy is None else energy / lasts
        return FrameEnergy(0, "ours", int(begun), begun, lasts, energy, power, 0.5, 9, 0.0, flag)

    frames = [frame(7.0, 1.0, 2.0), frame(8.0, 1.0, None), frame(9.0, 1.0, 4.0), frame(10.0, 1e-13, 1e-13)]
    line = _binned(frames, 0, 7.0, np.linspace(0.0, 4.0, 9))
    assert line[[0, 1, 4, 5]] == pytest.approx([2.0, 2.0, 4.0, 4.0])
    assert np.isnan(line[[2, 3, 6, 7]]).all()
