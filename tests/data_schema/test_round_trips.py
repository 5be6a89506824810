"""What is written is read back the same; what earlier versions wrote is read or refused."""

import dataclasses
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from example_tracks import example_track
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from made_summary import made_summary

from evenlight.data_schema.checking.file_checks import check_file
from evenlight.data_schema.checking.validation import validate
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import mapping_from_record, record_from_mapping
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.record_kinds import KINDS, FileFormat, RecordKind
from evenlight.data_schema.recordings.ramp import RampDesign
from evenlight.data_schema.storage.append_log import record_line
from evenlight.data_schema.storage.tables import read_rows, write_rows
from evenlight.data_schema.storage.text_files import write_json_record, write_toml_record
from evenlight.data_schema.threshold import Threshold, ThresholdFlag
from evenlight.data_schema.tracks.brightness_track import (
    BrightnessTrack,
    TrackHeader,
    read_track,
    write_track,
)
from evenlight.data_schema.tracks.loss_curves import (
    ARRAY_SHAPES,
    LossCurves,
    read_loss_curves,
    write_loss_curves,
)
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary

Strategies = Callable[[type[Any]], st.SearchStrategy[Any]]


def test_a_table_may_have_its_columns_in_any_order(tmp_path: Path) -> None:
    path = tmp_path / "thresholds.csv"
    row = Threshold(
        "01", "white", 0.5, 50.0, 1.0, 0.5, 2.0, 0.3, 1.2, 0.1, 0.02, None, 48, 12, ThresholdFlag.NONE
    )
    write_rows(path, Threshold, [row])
    lines = [",".join(reversed(line.split(","))) for line in path.read_text().splitlines()]
    path.write_text("\n".join(lines) + "\n")
    assert read_rows(Threshold, path) == [row]


def _columns(n: int, low: float, high: float) -> st.SearchStrategy[list[float]]:
    return st.lists(st.floats(low, high), min_size=n, max_size=n)


@settings(max_examples=25, deadline=None)
@given(data=st.data(), n=st.integers(1, 6))
def test_a_brightness_track_survives_csv_and_json(
    records_of: Strategies, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject, n: int
) -> None:
    factors = data.draw(_columns(n, 1e-3, 1.0))
    rate = np.append(np.diff(factors), 0.0) * data.draw(st.floats(0.0, 1e4))
    header = data.draw(records_of(TrackHeader))
    track = BrightnessTrack(
        times=np.arange(n) / data.draw(st.floats(1.0, 240.0)),
        factors=factors,
        contrast_loss=data.draw(_columns(n, 0.0, 1.0)),
        mean_luminance=data.draw(_columns(n, 0.0, 1e4)),
        rate=rate,
        rate_limit=np.abs(rate) + data.draw(_columns(n, 0.0, 1e4)),
        power=data.draw(_columns(n, 0.0, 1e3)),
        header=replace(header, display=None, panel=None),  # else they would not be those of the columns
    )
    path = tmp_path_factory.getbasetemp() / "track.csv"
    write_track(path, track)
    read = read_track(path)
    assert dataclasses.replace(read.header, files={}) == dataclasses.replace(track.header, files={})
    for name in ("times", "factors", "contrast_loss", "mean_luminance", "rate", "rate_limit", "power"):
        np.testing.assert_array_equal(getattr(read, name), getattr(track, name))


@settings(max_examples=25, deadline=None)
@given(data=st.data(), n=st.integers(1, 5), k=st.integers(2, 5))
def test_loss_curves_survive_npz(
    records_of: Strategies, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject, n: int, k: int
) -> None:
    display = data.draw(records_of(Display))
    curves = LossCurves(
        video=data.draw(st.text(max_size=12)),
        display=display,
        times=np.arange(n) * 0.04,
        durations=np.full(n, 0.04),
        factors=np.linspace(0.2, 1.0, k),
        loss=[[*sorted(data.draw(_columns(k - 1, 0.0, 1.0)), reverse=True), 0.0] for _ in range(n)],
        visible_contrast=data.draw(_columns(n, 1e-9, 1.0)),
        mean_luminance=np.array(data.draw(_columns(n, 0.5, 1.0))) * display.peak_luminance,
        channel_means=np.array([data.draw(_columns(3, 0.0, 1.0)) for _ in range(n)]),
        provenance=data.draw(records_of(Provenance)),
    )
    path = tmp_path_factory.getbasetemp() / "loss_curves.npz"
    write_loss_curves(path, curves)
    read = read_loss_curves(path)
    assert (read.video, read.display, read.provenance) == (curves.video, curves.display, curves.provenance)
    for name in ARRAY_SHAPES:
        np.testing.assert_array_equal(getattr(read, name), getattr(curves, name))


def test_numpy_scalars_are_written_as_plain_numbers() -> None:
    display = Display("x", np.float64(100.0), np.float64(0.0), 2.2, 30.0)
    assert type(mapping_from_record(display)["peak_luminance_cd_m2"]) is float


def test_units_are_part_of_the_keys() -> None:
    """cd/m^2 -> _cd_m2, s -> _s, a pure number -> nothing; an explicit key as it is."""
    keys = set(mapping_from_record(Display("x", 1.0, 0.0, 2.2, 30.0)))
    assert {"peak_luminance_cd_m2", "gamma", "pixels_per_degree"} <= keys
    assert {"ramp_durations_s", "relative_rates_per_s"} <= set(mapping_from_record(RampDesign()))


def test_arrays_of_a_record_are_copies_that_cannot_be_written_to() -> None:
    factors = np.array([0.5, 1.0])
    track = _two_frames(factors)
    factors[0] = 0.9
    assert track.factors[0] == 0.5
    with pytest.raises(ValueError, match="read-only"):
        track.factors[0] = 0.7


def _two_frames(factors: Any) -> BrightnessTrack:
    return replace(example_track([1.0, 1.0]), factors=factors)


# --- kinds of file

ARRAYS = (BrightnessTrack, LossCurves)  # which test_round_trips.py writes and reads

WRITERS: dict[FileFormat, Callable[[Path, Any], None]] = {
    FileFormat.TOML: write_toml_record,
    FileFormat.JSON: write_json_record,
    FileFormat.JSON_LINES: lambda path, record: write_text(path, record_line(record)),
    FileFormat.CSV: lambda path, record: write_rows(path, type(record), [record]),
}


def write_text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind.record not in ARRAYS], ids=lambda k: k.name)
@settings(max_examples=3, deadline=None)
@given(data=st.data())
def test_a_file_of_every_kind_is_read_back_equal(
    kind: RecordKind,
    records_of: Callable[[type[Any]], st.SearchStrategy[Any]],
    tmp_path_factory: pytest.TempPathFactory,
    data: st.DataObject,
) -> None:
    record = data.draw(records_of(kind.record))
    # Python before 3.13 writes a lone end of line into a table without quotes.
    assume(kind.file_format is not FileFormat.CSV or "\\r" not in repr(record))
    path = tmp_path_factory.getbasetemp() / f"{kind.name}.{kind.file_format.value}"
    WRITERS[kind.file_format](path, record)
    checked = check_file(path, kind)
    assert checked.problems == []
    assert checked.record == record


# --- earlier files

EARLIER = json.loads((Path(__file__).parent / "earlier_files.json").read_text())

GONE = {  # what CHANGELOG.md says is gone, part of another file, or read by a command alone
    *("agreement.csv", "control.json", "errors.csv", "judgement.csv", "power_table.csv", "tuning.json"),
    *("light.csv", "light_arrivals.csv", "light_flips.csv", "light_log.json", "light_results.json"),
    *("a_benchmark.csv", "a_growth.csv", "a_claims.csv", "benchmark.json", "target_sweep.csv"),
    *("a.catalogue.csv", "a.published.csv", "power_levels.csv"),
}


def written(name: str, folder: Path) -> Path:
    path = folder / name.partition("/")[2]
    path.write_text(EARLIER[name], encoding="utf-8")
    return path


@pytest.mark.parametrize("name", sorted(name for name in EARLIER if name.partition("/")[2] not in GONE))
def test_a_file_of_an_earlier_version_is_read_with_all_that_it_says(name: str, tmp_path: Path) -> None:
    path = written(name, tmp_path)
    [checked] = validate(path)
    assert checked.problems == []
    if path.suffix in (".json", ".jsonl"):
        former = getattr(type(checked.record), "FORMER_KEYS", ())
        own = {key: value for key, value in json.loads(EARLIER[name]).items() if key not in former}
        assert of_keys(own, mapping_from_record(checked.record)) == own


def of_keys(own: Any, told: Any) -> Any:
    """What is told under an earlier file's keys, those of records in it too."""
    if not (isinstance(own, dict) and isinstance(told, dict)):
        return told
    return {key: of_keys(value, told.get(key)) for key, value in own.items()}


@pytest.mark.parametrize("name", sorted(name for name in EARLIER if name.partition("/")[2] in GONE))
def test_a_file_that_is_no_kind_any_more_is_taken_for_no_other(name: str, tmp_path: Path) -> None:
    path = written(name, tmp_path)
    [checked] = validate(tmp_path)
    assert (checked.words, checked.problems) == ("", [])
    with pytest.raises(InputError, match="nothing that Evenlight knows"):
        next(validate(path))


# --- former loss curves

CURVES = LossCurves(
    video="v",
    display=Display("d", 100.0, 0.1, 2.2, 30.0),
    times=np.array([0.0, 0.04]),
    durations=np.array([0.04, 0.04]),
    factors=np.array([0.2, 1.0]),
    loss=np.array([[0.5, 0.0], [0.25, 0.0]]),
    visible_contrast=np.array([0.5, 0.5]),
    mean_luminance=np.array([20.0, 30.0]),
    channel_means=np.full((2, 3), 0.25),
    provenance=Provenance(),
)


def with_header(path: Path, **more: object) -> Path:
    """Add keys to the header of a file, and the array that told how much of each frame was counted."""
    write_loss_curves(path, CURVES)
    with np.load(path) as content:
        arrays = {name: content[name] for name in content}
    header = json.loads(str(arrays.pop("header"))) | more
    np.savez(path, allow_pickle=False, header=json.dumps(header), counted=np.array([1.0, 0.06]), **arrays)
    return path


@pytest.mark.parametrize("tolerance", [0.0, 0.001])
def test_curves_as_they_were_by_default_are_read(tmp_path: Path, tolerance: float) -> None:
    read = read_loss_curves(with_header(tmp_path / "c.npz", tolerance=tolerance))
    np.testing.assert_array_equal(read.loss, CURVES.loss)


def test_curves_that_were_counted_more_roughly_are_refused_with_the_way_to_make_them_anew(
    tmp_path: Path,
) -> None:
    file = with_header(tmp_path / "c.npz", tolerance=0.02)
    with pytest.raises(
        InputError, match=r"curves right to 0.02 alone; make them anew with `evenlight optimize`"
    ):
        read_loss_curves(file)


def test_other_keys_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="unknown key 'tolerances'"):
        read_loss_curves(with_header(tmp_path / "c.npz", tolerances=0.001))


def test_a_summary_that_tells_what_was_counted_is_read() -> None:
    summary = made_summary()
    former = mapping_from_record(summary) | {"curves_tolerance": 0.001, "counted": 0.4}
    assert record_from_mapping(OptimizationSummary, former, "summary.json") == summary
