"""What is written is read back the same, for every record and every format it has."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evenlight.data_schema.display import Display
from evenlight.data_schema.mapping import mapping_from_record, record_from_mapping
from evenlight.data_schema.power_model import PowerModel
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.recordings.ramp import FrameLog, RampDesign, RampTrial
from evenlight.data_schema.recordings.rig import Rig
from evenlight.data_schema.recordings.session import SessionEvent, SessionManifest
from evenlight.data_schema.storage.tables import read_rows, write_rows
from evenlight.data_schema.storage.text_files import (
    read_json_record,
    read_toml_record,
    write_json_record,
    write_toml_record,
)
from evenlight.data_schema.threshold import Threshold, ThresholdFlag
from evenlight.data_schema.tracks.brightness_track import (
    BrightnessTrack,
    BudgetUnit,
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
JSON_AND_TOML = [
    Display,
    PowerModel,
    Provenance,
    RampDesign,
    RampTrial,
    FrameLog,
    Rig,
    SessionEvent,
    RateLimit,
    SessionManifest,
    Threshold,
    TrackHeader,
    OptimizationSummary,
]


@pytest.mark.slow
@pytest.mark.parametrize("cls", JSON_AND_TOML)
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_json_gives_back_the_record(
    cls: type[Any], records_of: Strategies, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    record = data.draw(records_of(cls))
    path = tmp_path_factory.getbasetemp() / f"{cls.__name__}.json"
    write_json_record(path, record)
    assert read_json_record(cls, path) == record


@pytest.mark.slow
@pytest.mark.parametrize("cls", [Display, PowerModel, RampDesign, Rig])
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_toml_gives_back_the_record(
    cls: type[Any], records_of: Strategies, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    record = data.draw(records_of(cls))
    path = tmp_path_factory.getbasetemp() / f"{cls.__name__}.toml"
    write_toml_record(path, record)
    assert read_toml_record(cls, path) == record


@pytest.mark.slow
@pytest.mark.parametrize("cls", [Threshold, RampTrial])
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_a_table_gives_back_its_rows(
    cls: type[Any], records_of: Strategies, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    records = data.draw(st.lists(records_of(cls), max_size=4))
    path = tmp_path_factory.getbasetemp() / f"{cls.__name__}.csv"
    write_rows(path, cls, records)
    assert read_rows(cls, path) == records


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
    track = BrightnessTrack(
        times=np.arange(n) / data.draw(st.floats(1.0, 240.0)),
        factors=factors,
        contrast_loss=data.draw(_columns(n, 0.0, 1.0)),
        mean_luminance=data.draw(_columns(n, 0.0, 1e4)),
        rate=np.append(np.diff(factors), 0.0) * data.draw(st.floats(0.0, 1e4)),
        rate_limit=data.draw(_columns(n, 0.0, 1e4)),
        power=data.draw(_columns(n, 0.0, 1e3)),
        header=data.draw(records_of(TrackHeader)),
    )
    path = tmp_path_factory.getbasetemp() / "track.csv"
    write_track(path, track)
    read = read_track(path)
    assert read.header == track.header
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
    header = TrackHeader("v", "d", "f", "p", "r", 0.5, BudgetUnit.FACTOR, "s", Provenance())
    rest = [np.zeros(2)] * 5
    return BrightnessTrack(np.array([0.0, 0.04]), factors, *rest, header=header)


@pytest.mark.slow
@settings(max_examples=50, deadline=None)
@given(data=st.data())
def test_a_mapping_survives_the_record(records_of: Strategies, data: st.DataObject) -> None:
    """record -> mapping -> record -> mapping: the second mapping is the first."""
    mapping = mapping_from_record(data.draw(records_of(SessionManifest)))
    assert mapping_from_record(record_from_mapping(SessionManifest, mapping, "memory")) == mapping
