"""A file that cannot be used: one line names the file, the value, and what would be right."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from example_tracks import HEADER, example_track

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.power_model import PanelKind, PowerModel
from evenlight.data_schema.provenance import SCHEMA_VERSION, Provenance
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.recordings.ramp import RampDesign
from evenlight.data_schema.recordings.session import SessionManifest
from evenlight.data_schema.storage.tables import read_rows
from evenlight.data_schema.storage.text_files import read_json_record, read_toml_record
from evenlight.data_schema.threshold import Threshold
from evenlight.data_schema.tracks.brightness_track import (
    TRACK_COLUMNS,
    read_track,
    write_track,
)
from evenlight.data_schema.tracks.loss_curves import (
    ARRAY_SHAPES,
    LossCurves,
    read_loss_curves,
    write_loss_curves,
)
from evenlight.method.preset_files import PRESETS, load_display, load_power_model, load_rate_limit

READERS: list[tuple[str, Callable[[Path], Any]]] = [
    ("file.json", lambda path: read_json_record(RateLimit, path)),
    ("file.toml", lambda path: read_toml_record(Display, path)),
    ("file.csv", lambda path: read_rows(Threshold, path)),
    ("file.npz", read_loss_curves),
]
LIMIT = {
    "name": "x",
    "display_name": "d",
    "display_fingerprint": "f",
    "form": "ln_rate",
    "coefficients": [0.5, 0.1],
    "luminance_range_cd_m2": [1.0, 100.0],
}
DISPLAY = (
    'name = "x"\npeak_luminance_cd_m2 = 100\nblack_level_cd_m2 = 0.1\ngamma = 2.2\npixels_per_degree = 30\n'
)
THRESHOLD = (
    "participant_id,screen,factor,luminance_cd_m2,threshold_cd_m2_s,ci_low,ci_high,standard_error_ln,width,"
    "guess_rate,lapse_rate,false_alarm_rate,n_trials,n_catch,flag\n"
    "01,white,0.5,52.2,2,1,3,0.2,1.1,0.1,0.02,,48,12,\n"
)


def refusal(read: Callable[[Path], Any], path: Path) -> str:
    """The message with which a file is refused: one line that begins with its name."""
    with pytest.raises(InputError) as caught:
        read(path)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(str(path).removesuffix(path.suffix))
    return message.removeprefix(str(path))


@pytest.mark.parametrize(("name", "read"), READERS)
def test_a_missing_file_and_a_folder_are_named(
    name: str, read: Callable[[Path], Any], tmp_path: Path
) -> None:
    assert refusal(read, tmp_path / name).startswith(": no such file; expected ")
    (tmp_path / name).mkdir()
    assert refusal(read, tmp_path / name).startswith(": is a folder; expected ")


@pytest.mark.parametrize(("name", "read"), READERS)
@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\x00" * 64,
        bytes(range(256)),
        b"\x89PNG\r\n\x1a\n" + b"\xff" * 99,
        b"PK\x03\x04" + b"\x07" * 60,
        b"{}",
        b"[" * 100_000,
        b"{" * 3,
        b"9" * 5000,  # longer than Python turns into a number
        "naïve = 'ü'".encode("latin-1"),
    ],
    ids=["empty", "zeros", "all bytes", "png", "zip", "{}", "nested", "open", "digits", "latin-1"],
)
def test_garbage_is_refused(name: str, read: Callable[[Path], Any], content: bytes, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content)
    assert refusal(read, tmp_path / name)


@pytest.mark.parametrize(
    ("content", "got"),
    [("[]", "a list"), ("3", "3"), ("null", "null"), ("true", "true"), ('"text"', "'text'")],
)
def test_json_of_another_kind_is_refused(content: str, got: str, tmp_path: Path) -> None:
    (tmp_path / "r.json").write_text(content)
    message = refusal(lambda path: read_json_record(RateLimit, path), tmp_path / "r.json")
    assert message == f": expected the keys of a rate limit, got {got}"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"name": None}, ": name: expected text, got null"),
        ({"name": 3}, ": name: expected text, got 3"),
        ({"form": "cubic"}, ": form: expected one of 'ln_rate', 'rate', 'log_log', got 'cubic'"),
        ({"form": {}}, ": form: expected one of 'ln_rate', 'rate', 'log_log', got a table"),
        ({"coefficients": 3.0}, ": coefficients: expected a list, got 3.0"),
        ({"coefficients": [1.0, "2"]}, ": coefficients: expected a number, got '2'"),
        ({"coefficients": [True]}, ": coefficients: expected a number, got true"),
        ({"coefficients": [10**400]}, "expected a number below 1.8e308"),
        ({"coefficients": []}, "coefficients must hold at least 1 number"),
        ({"luminance_range_cd_m2": [1.0]}, "luminance_range_cd_m2: expected 2 values, got 1"),
        ({"luminance_range_cd_m2": [5.0, 5.0]}, "one luminance, for a constant), got 5 to 5"),
        ({"luminance_range_cd_m2": [-1, 5.0]}, "luminance_range_cd_m2 must be at least 1e-06 cd/m^2, got -1"),
        ({"simulated": 1}, ": simulated: expected true or false, got 1"),
        ({"band_lower_cd_m2_s": [1.0]}, "the three band lists must be equally long"),
        ({"point_rate_cd_m2_s": [1.0]}, "must be equally long"),
        ({"provenance": "me"}, ": provenance: expected the keys of a provenance, got 'me'"),
        ({"provenance": {"seed": 1.5}}, ": provenance: seed: expected a whole number or null, got 1.5"),
        ({"provenance": {"inputs": [1]}}, "inputs: expected a table of names and values, got a list"),
        ({"provenance": {"inputs": {"a": 1}}}, "inputs: a: expected text, got 1"),
        ({"coeficients": [1.0]}, ": unknown key 'coeficients'; did you mean 'coefficients'?"),
        ({"zzz": 1}, ": unknown key 'zzz'; known are name, display_name"),
    ],
)
def test_a_wrong_value_is_named_with_what_would_be_right(
    changes: dict[str, Any], message: str, tmp_path: Path
) -> None:
    (tmp_path / "r.json").write_text(json.dumps(LIMIT | changes))
    assert message in refusal(lambda path: read_json_record(RateLimit, path), tmp_path / "r.json")


@pytest.mark.parametrize("key", LIMIT)
def test_each_required_key_is_missed(key: str, tmp_path: Path) -> None:
    (tmp_path / "r.json").write_text(json.dumps({k: v for k, v in LIMIT.items() if k != key}))
    message = refusal(lambda path: read_json_record(RateLimit, path), tmp_path / "r.json")
    assert message == f": the key {key!r} of a rate limit is missing"


LINES = json.dumps(
    LIMIT, indent=1
)  # {, name, display_name, display_fingerprint, form, coefficients, 0.5, ...


@pytest.mark.parametrize(
    ("text", "message"),
    [
        # RFC 8259, section 6: NaN and Infinity are not permitted, though Python's parser takes them.
        (LINES.replace("0.5", "NaN"), "not valid JSON at line 7 (NaN is no number of JSON)"),
        (LINES.replace("0.5", "Infinity"), "not valid JSON at line 7 (Infinity is no number of JSON)"),
        (LINES.replace("0.5", "-Infinity"), "not valid JSON at line 7 (-Infinity is no number of JSON)"),
        (LINES.replace("0.5", "1e999"), "coefficients must be finite, got inf"),  # above 1.8e308
        ('{"name": "a", "name": "b"}', "the key 'name' is there twice"),
        (LINES[: LINES.index('"form"')], "not valid JSON at line 5"),  # it ends there
    ],
)
def test_json_that_is_none_names_line_and_word(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "r.json").write_text(text)
    assert message in refusal(lambda path: read_json_record(RateLimit, path), tmp_path / "r.json")


@pytest.mark.parametrize("place", ["provenance", "top"])
def test_a_newer_schema_is_refused_before_its_keys_are_read(place: str, tmp_path: Path) -> None:
    newer = {"schema_version": SCHEMA_VERSION + 1}
    content = LIMIT | {"new_key": 1} | ({"provenance": newer} if place == "provenance" else newer)
    (tmp_path / "r.json").write_text(json.dumps(content))
    message = refusal(lambda path: read_json_record(RateLimit, path), tmp_path / "r.json")
    assert f"schema version {SCHEMA_VERSION + 1}, this Evenlight reads up to {SCHEMA_VERSION}" in message


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("gamma = 2.2", "gamma = nan", "gamma must be finite, got nan"),
        ("gamma = 2.2", "gamma = inf", "gamma must be finite, got inf"),
        ("gamma = 2.2", "gamma = 2,2", "not valid TOML"),
        ("gamma = 2.2", "gamma = '2.2'", "gamma: expected a number, got '2.2'"),
        ("gamma = 2.2", "gamma = 1979-05-27", "gamma: expected a number"),
        ("gamma = 2.2", "gamma = 2.2\ngamma = 2.2", "not valid TOML"),
        (
            "gamma = 2.2\npixels_per_degree = 30",
            "pixels_per_degree = 30\n[gamma]",
            "gamma: expected a number, got a table",
        ),
        ("black_level_cd_m2 = 0.1", "black_level_cd_m2 = 100", "need black_level < peak_luminance"),
        ("black_level_cd_m2 = 0.1", "black_level = 0.1", "did you mean 'black_level_cd_m2'?"),
    ],
)
def test_a_wrong_display_is_told_what_is_wrong(old: str, new: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "d.toml").write_text(DISPLAY.replace(old, new))
    assert message in refusal(lambda path: read_toml_record(Display, path), tmp_path / "d.toml")


def test_a_byte_order_mark_does_no_harm(tmp_path: Path) -> None:
    """Editors of other systems put U+FEFF before the first line."""
    (tmp_path / "d.toml").write_text("\ufeff" + DISPLAY)
    (tmp_path / "t.csv").write_text("\ufeff" + THRESHOLD)
    assert read_toml_record(Display, tmp_path / "d.toml").gamma == 2.2
    assert read_rows(Threshold, tmp_path / "t.csv")[0].threshold == 2.0


def test_a_nested_record_is_named_by_its_keys(
    manifest_of: Callable[..., SessionManifest], tmp_path: Path
) -> None:
    from evenlight.data_schema.mapping import mapping_from_record

    content = mapping_from_record(manifest_of())
    content["display"]["gamma"] = -1.0
    (tmp_path / "m.json").write_text(json.dumps(content))
    message = refusal(lambda path: read_json_record(SessionManifest, path), tmp_path / "m.json")
    assert message == ": display: gamma must be at least 0.5, got -1"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("factor,", "factr,", ": unknown column 'factr'; did you mean 'factor'?"),
        ("screen,factor", "screen,screen", ": the column 'screen' is there twice"),
        (",flag\n", "\n", ": the column 'flag' of a threshold table is missing"),
        (",48,12,\n", ",48,12\n", ", line 2: expected 15 cells, got 14; the table is torn"),
        (",48,12,\n", ",4", ", line 2: expected 15 cells, got 13; the table is torn"),
        (",48,", ",48.5,", ", line 2: n_trials: expected a whole number, got '48.5'"),
        (",52.2,", ",bright,", ", line 2: luminance_cd_m2: expected a number, got 'bright'"),
        (",52.2,", ",nan,", ", line 2: luminance_cd_m2: expected a number, got 'nan'"),
        (",52.2,", ",5_2.2,", ", line 2: luminance_cd_m2: expected a number, got '5_2.2'"),
        (",52.2,", ",,", ", line 2: luminance_cd_m2: expected a number, got ''"),
        (",52.2,", ",-1,", ", line 2: luminance_cd_m2 must be above 0 cd/m^2, got -1"),
        (",2,1,3,", ",2,2.5,3,", ", line 2: need ci_low <= threshold <= ci_high, got 2.5, 2, 3"),
        (",12,\n", ",12,odd\n", ", line 2: flag: expected one of '', 'all_yes'"),
        (",white,", ",blue,", ", line 2: screen must be one of white, gray, got 'blue'"),
        ("\n01,", "\n0 1,", ", line 2: participant_id must match ^[0-9A-Za-z]+$, got '0 1'"),
    ],
)
def test_a_wrong_table_is_told_line_and_column(old: str, new: str, message: str, tmp_path: Path) -> None:
    text = THRESHOLD.replace(old, new, 1)
    assert text != THRESHOLD
    (tmp_path / "t.csv").write_text(text)
    assert refusal(lambda path: read_rows(Threshold, path), tmp_path / "t.csv").startswith(message)


def test_an_empty_table_is_no_table_but_one_without_rows_is(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("")
    assert ": is empty; expected a threshold table" in refusal(
        lambda path: read_rows(Threshold, path), tmp_path / "t.csv"
    )
    (tmp_path / "t.csv").write_text(THRESHOLD.split("\n")[0] + "\n\n")
    assert read_rows(Threshold, tmp_path / "t.csv") == []


@pytest.fixture
def track_file(tmp_path: Path) -> Path:
    """A track of three frames: 0, 0, 1.0, ... 1, 0.04, 0.9, ... 2, 0.08, 0.8, ..."""
    header = replace(HEADER, budget=0.9)
    columns = {"contrast_loss": 0.25, "mean_luminance": 20.0, "rate": -1.5, "rate_limit": 2.5, "power": 0.125}
    write_track(tmp_path / "track.csv", example_track([1.0, 0.9, 0.8], header=header, **columns))
    return tmp_path / "track.csv"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (",".join(TRACK_COLUMNS), "", ": is empty"),
        ("factor,", "faktor,", ": unknown column 'faktor'; did you mean 'factor'?"),
        (",power_w", "", ": the column 'power_w' of a brightness track (csv) is missing"),
        ("\n1,0.04", "\n2,0.04", ", line 3: frame: expected 1, the frames from 0 on, got '2'"),
        ("\n1,0.04", "\n1,0.12", ": time_s must rise from frame to frame"),
        (",0.9,", ",NaN,", ", line 3: factor: expected a number, got 'NaN'"),
        (",0.9,", ",1.5,", ": factor must be at most 1, got 1.5"),
        (",0.9,", ",0,", ": factor must be above 0, got 0"),
        ("2,0.08,0.8,0.25,20.0,-1.5,2.5,0.125\n", "2,0.08,0.", ", line 4: expected 8 cells, got 3"),
    ],
)
def test_a_wrong_track_is_told_line_and_column(old: str, new: str, message: str, track_file: Path) -> None:
    text = track_file.read_text()
    assert old in text
    track_file.write_text("" if not new and old.startswith("frame") else text.replace(old, new, 1))
    assert refusal(read_track, track_file).startswith(message)


def test_a_track_without_frames_or_header_is_refused(track_file: Path) -> None:
    header = track_file.with_suffix(".json")
    first = track_file.read_text().partition("\n")[0]
    track_file.write_text(first + "\n")
    assert "expected a row for each frame, got none" in refusal(read_track, track_file)
    header.unlink()
    assert "track.json: no such file; there is no brightness track" in refusal(read_track, track_file)


@pytest.fixture
def curves() -> LossCurves:
    return LossCurves(
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


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"header": np.array("no json")}, ": holds no loss curves"),
        ({"header": np.array("[]")}, ": header: expected the keys of a curves header, got a list"),
        ({"header": np.array("{}")}, ": header: the key 'video' of a curves header is missing"),
        ({"loss": np.zeros((3, 2))}, ": loss must have the shape (2, 2), got (3, 2)"),
        ({"loss": np.full((2, 2), np.nan)}, ": loss must be finite, got nan"),
        ({"loss": np.full((2, 2), 1.5)}, ": loss must be at most 1, got 1.5"),
        ({"loss": np.array([["a", "b"]] * 2)}, ": could not convert string to float"),
        ({"loss": np.array([[{}, {}]] * 2, dtype=object)}, ": holds no loss curves"),
        ({"factors": np.array([1.0, 0.2])}, ": factors must rise to 1 with at least two knots"),
        ({"factors": np.array([0.2, 0.9])}, ": factors must rise to 1 with at least two knots"),
        ({"times": np.array([0.04, 0.0])}, ": times must rise from frame to frame"),
        ({"durations": np.array([0.04, 0.0])}, ": durations must be above 0 s, got 0"),
        ({"times": None}, "times"),
    ],
)
def test_wrong_loss_curves_are_told_what_is_wrong(
    changes: dict[str, Any], message: str, curves: LossCurves, tmp_path: Path
) -> None:
    path = tmp_path / "c.npz"
    write_loss_curves(path, curves)
    with np.load(path) as content:
        arrays = {name: content[name] for name in ("header", *ARRAY_SHAPES)} | changes
    np.savez(path, allow_pickle=True, **{name: array for name, array in arrays.items() if array is not None})
    assert message in refusal(read_loss_curves, path)


def test_loss_curves_cut_short_or_corrupt_are_refused(curves: LossCurves, tmp_path: Path) -> None:
    path = tmp_path / "c.npz"
    write_loss_curves(path, curves)
    whole = path.read_bytes()
    for broken in (whole[: len(whole) // 2], whole[:200] + b"\xff" * 50 + whole[250:]):
        path.write_bytes(broken)
        assert "expected loss curves (npz)" in refusal(read_loss_curves, path)


def test_a_plain_array_is_no_file_of_loss_curves(tmp_path: Path) -> None:
    np.save(tmp_path / "c.npy", np.zeros(3))
    assert "holds no loss curves" in refusal(read_loss_curves, tmp_path / "c.npy")


def test_a_design_without_rates_says_so() -> None:
    with pytest.raises(ValueError, match=r"relative_rates must hold at least 1 number\(s\), got 0"):
        RampDesign(relative_rates=())


# --- numbers that are none

NO_NUMBERS = ("nan", "inf", "-inf")


@pytest.mark.parametrize("word", NO_NUMBERS)
def test_no_preset_holds_a_number_that_is_none(word: str, tmp_path: Path) -> None:
    for load, preset, key in (
        (load_display, "varjo-xr3.display", "peak_luminance_cd_m2"),
        (load_power_model, "surace2025.power", "base_power_w"),
    ):
        lines = (PRESETS / f"{preset}.toml").read_text().splitlines()
        path = tmp_path / "odd.toml"
        path.write_text("\n".join(f"{key} = {word}" if line.startswith(key) else line for line in lines))
        assert f"{key} must be finite, got {word}" in refusal(lambda path, load=load: load(str(path)), path)


@pytest.mark.parametrize(
    ("word", "said"),
    [("NaN", "NaN is no number"), ("-Infinity", "-Infinity is no number"),
     ("1e999", "must be finite, got inf")],
)  # fmt: skip
@pytest.mark.parametrize("key", ["coefficients", "luminance_range_cd_m2", "band_lower_cd_m2_s"])
def test_no_rate_limit_holds_a_number_that_is_none(key: str, word: str, said: str, tmp_path: Path) -> None:
    content = json.loads((PRESETS / "surace2025.rate_limit.json").read_text())
    content[key][0] = 12345.0
    path = tmp_path / "odd.json"
    path.write_text(json.dumps(content).replace("12345.0", word))
    assert said in refusal(lambda path: load_rate_limit(str(path)), path)


@pytest.mark.parametrize("name", ["loss", "durations", "mean_luminance", "channel_means", "factors"])
@pytest.mark.parametrize("word", NO_NUMBERS)
def test_no_array_of_loss_curves_holds_a_number_that_is_none(
    name: str, word: str, curves: LossCurves, tmp_path: Path
) -> None:
    values = np.array(getattr(curves, name))
    values.flat[1] = float(word)
    with pytest.raises(ValueError, match=f"must be finite, got {word}"):
        replace(curves, **{name: values})
    path = tmp_path / "odd.npz"
    write_loss_curves(path, curves)
    with np.load(path) as content:
        arrays = dict(content) | {name: values}
    np.savez(path, **arrays)
    assert f"must be finite, got {word}" in refusal(read_loss_curves, path)


@pytest.mark.parametrize(
    ("column", "cell", "words"),
    [
        (4, "1e300", "mean_luminance_cd_m2 must be at most 2e"),
        (5, "-1.0", "line 2: rate_cd_m2_s of frame 0 contradicts the factors: at 0.5 expected 0 to "),
        (5, "1e4", "line 2: rate_cd_m2_s of frame 0 contradicts"),
        (
            4,
            "17000",
            "line 2: mean_luminance_cd_m2 of frame 0 contradicts the factors: at 0.5 expected 0.1 to",
        ),
        (7, "1e6", "line 2: power_w of frame 0 contradicts the factors: at 0.5 expected 1, got 1e+06"),
    ],
)
def test_a_track_that_contradicts_itself_is_refused(
    make_stimulus: Callable[..., None], tmp_path: Path, column: int, cell: str, words: str
) -> None:
    make_stimulus(tmp_path, [0.5, 0.6, 0.6])
    path = tmp_path / "track.csv"
    track = read_track(path)
    panel = PowerModel("p", PanelKind.LCD, 0.5, power_per_luminance=0.01, peak_luminance=100.0)
    header = replace(track.header, display=load_display("varjo-xr3"), panel=panel)
    write_track(path, replace(track, header=header, power=0.5 + track.factors))
    read_track(path)
    lines = path.read_text().splitlines()
    cells = lines[1].split(",")
    cells[column] = cell
    path.write_text("\n".join([lines[0], ",".join(cells), *lines[2:]]) + "\n")
    assert words in refusal(read_track, path)
