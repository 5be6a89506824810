"""Files that contradict themselves, or describe what nobody can build, are refused in one line."""

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import evenlight
from evenlight.data_schema.checking.validation import validate
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.storage.text_files import read_json_record, write_json_record
from evenlight.data_schema.tracks.brightness_track import read_track, require_light_of
from evenlight.data_schema.tracks.loss_curves import LossCurves, read_loss_curves, write_loss_curves
from evenlight.method.preset_files import load_display, load_rate_limit

PUBLISHED = load_rate_limit("surace2025")


def changed(number: int, by: float) -> RateLimit:
    """The published limit with another coefficient."""
    coefficients = list(PUBLISHED.coefficients)
    coefficients[number] += by
    return dataclasses.replace(PUBLISHED, coefficients=tuple(coefficients))


@pytest.mark.parametrize("number", range(5))
@pytest.mark.parametrize("by", [3.0, -3.0, 0.7, -0.7])
def test_any_coefficient_changed_by_a_factor_of_two_is_noticed(number: int, by: float) -> None:
    """P_k(1) = 1: at 104.4 cd/m^2 the curve moves by e^0.7 = 2, and its band reaches a factor of 1.5."""
    with pytest.raises(ValueError, match=r"the curve contradicts its own band: at .* cd/m"):
        changed(number, by)


def without_band(**changes: Any) -> RateLimit:
    return dataclasses.replace(PUBLISHED, band_luminance=(), band_lower=(), band_upper=(), **changes)


@pytest.mark.parametrize("number", range(5))
def test_without_a_band_the_thresholds_tell(number: int) -> None:
    coefficients = list(PUBLISHED.coefficients)
    coefficients[number] += 3.0
    with pytest.raises(ValueError, match="the curve contradicts the points that it was fitted to: at "):
        without_band(coefficients=tuple(coefficients))


def test_thresholds_outside_the_luminances_measured_are_of_another_limit() -> None:
    moved = (*PUBLISHED.point_luminance[:-1], 160.0)
    with pytest.raises(ValueError, match=r"must lie in luminance_range, 8\.8 to 104\.4, got 160"):
        dataclasses.replace(PUBLISHED, point_luminance=moved)


def test_people_who_differ_and_numbers_with_three_digits_are_no_contradiction() -> None:
    """At a luminance the curve lies between the thresholds of two people, though a factor of 5 from each."""
    both = tuple(rate * far for rate in PUBLISHED.point_rate for far in (0.2, 5.0))
    places = tuple(at for at in PUBLISHED.point_luminance for _ in (1, 2))
    assert without_band(point_luminance=places, point_rate=both).point_rate == both
    rounded = tuple(float(f"{c:.3g}") for c in PUBLISHED.coefficients)
    edges = {
        name: tuple(float(f"{edge:.3g}") for edge in getattr(PUBLISHED, name))
        for name in ("band_lower", "band_upper")
    }
    assert dataclasses.replace(PUBLISHED, coefficients=rounded, **edges).coefficients == rounded


def only_problem(path: Path) -> str:
    """What `evenlight validate` says of a file."""
    (problem,) = [problem for checked in validate(path) for problem in checked.problems]
    return problem


@pytest.fixture
def broken_limit(tmp_path: Path) -> Path:
    """The published limit, 20 times faster."""
    path = tmp_path / "rate_limit.json"
    write_json_record(path, PUBLISHED)
    content = json.loads(path.read_text())
    content["coefficients"][0] += 3
    path.write_text(json.dumps(content))
    return path


def test_readers_and_validate_name_file_luminance_curve_and_band(broken_limit: Path) -> None:
    """At 8.8 cd/m^2 the published curve is 0.2638, e^3 = 20.1 times that 5.3; the band is in the file."""
    with pytest.raises(InputError) as refused:
        read_json_record(RateLimit, broken_limit)
    told = str(refused.value)
    assert told.startswith(f"{broken_limit}: the curve contradicts its own band: at 8.8 cd/m^2")
    assert "the coefficients give 5.3 cd/m^2/s, and the band reaches from 0.18 to 0.388" in told
    assert "or fit again" in told
    assert "\n" not in told
    assert "contradicts its own band" in only_problem(broken_limit)
    with pytest.raises(InputError, match="contradicts its own band"):
        evenlight.optimize("checkerboard", 0.5, rate_limit=broken_limit)


@pytest.mark.slow
@pytest.mark.parametrize("arguments", [("optimize", "--budget", 0.5), ("control", "--target-loss", 0.05)])
def test_commands_refuse_it_in_one_line(command, broken_limit: Path, tmp_path: Path, arguments) -> None:
    name, *options = arguments
    asked = (
        name,
        "checkerboard",
        "--fps",
        2,
        "--rate-limit",
        broken_limit,
        "--out",
        tmp_path / "o",
        *options,
    )
    result = command(*asked)
    assert (result.code, result.err.count("\n"), (tmp_path / "o").exists()) == (2, 1, False)
    assert str(broken_limit) in result.err
    assert "contradicts its own band" in result.err


@pytest.mark.parametrize(
    ("name", "peak", "black", "gamma", "reflected"),
    [
        ("linear, as measured", 100.0, 0.1, 0.98, 0.0),
        ("OLED", 600.0, 0.0, 2.4, 0.0),
        ("mastering monitor", 10_000.0, 0.0005, 2.4, 0.0),
        ("projector in a lit room", 80.0, 0.4, 2.8, 60.0),
        ("worn panel behind a dark filter", 0.1, 0.02, 1.8, 0.0),
    ],
)
def test_displays_that_exist_are_accepted(
    name: str, peak: float, black: float, gamma: float, reflected: float
) -> None:
    assert Display(name, peak, black, gamma, 40.0, reflected).name == name


def first(curves: LossCurves, name: str, value: Any) -> np.ndarray:
    """An array of loss curves with another first number."""
    array = np.array(getattr(curves, name))
    array[0] = value
    return array


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        (
            "mean_luminance",
            0.0,
            r"mean_luminance of frame 0: expected what 'varjo-xr3' emits, 0\.2 to 104\.4",
        ),
        ("mean_luminance", 1e300, "mean_luminance must be at most 1e"),
        ("mean_luminance", 300.0, "mean_luminance of frame 0: .* got 300"),
        ("loss", np.linspace(0.0, 0.5, 33), "loss of frame 0: expected 0 at factor 1.* got 0.5"),
        (
            "loss",
            np.sin(np.linspace(0, 3 * np.pi, 33)) ** 2,
            "no rise with the factor, and this is one, got 1;",
        ),
        ("visible_contrast", 0.0, "loss of frame 0: expected 0 where nothing is visible"),
    ],
)
def test_loss_curves_of_no_video_are_refused(
    make_curves: Callable[..., LossCurves], tmp_path: Path, name: str, value: Any, words: str
) -> None:
    curves, path = make_curves([0.4, 0.2]), tmp_path / "loss_curves.npz"
    write_loss_curves(path, curves)
    with np.load(path) as content:
        np.savez(path, **{**content, name: first(curves, name, value)})
    with pytest.raises(InputError, match=words) as refused:
        read_loss_curves(path)
    assert str(refused.value).startswith(f"{path}: ")
    assert "\n" not in str(refused.value)
    assert str(path) in only_problem(path)


def test_curves_in_memory_are_judged_as_those_of_a_file(make_curves: Callable[..., LossCurves]) -> None:
    with pytest.raises(InputError, match="mean_luminance of frame 0"):
        evenlight.optimize(make_curves([0.4, 0.2], luminance=0.0), 0.5)


def test_a_track_is_as_bright_as_its_factors_make_the_display(
    make_stimulus: Callable[..., None], tmp_path: Path
) -> None:
    """40 cd/m^2 at factor 1 are 20 at 0.5; 60 are more than the 52.2 that white has there."""
    make_stimulus(tmp_path, [0.5, 0.5])
    path, display = tmp_path / "track.csv", load_display("varjo-xr3")
    require_light_of(read_track(path), display, path)
    brighter = dataclasses.replace(read_track(path), mean_luminance=np.array([20.0, 60.0]))
    with pytest.raises(
        InputError, match=r"frame 1: mean_luminance_cd_m2 of 60 .* factor 0.5.* has 52.2 cd/m"
    ):
        require_light_of(brighter, display, path)
