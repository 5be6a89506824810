"""Presets are what their sources say, and names that are none get help."""

import pytest

from evenlight.data_schema.contrast_model import DEFAULT_MODEL, Visibility
from evenlight.data_schema.errors import InputError
from evenlight.method.contrast.measures import MEASURES
from evenlight.method.preset_files import (
    load_contrast_model,
    load_display,
    load_power_model,
    load_rate_limit,
    preset_names,
)


def test_the_display_is_that_of_the_authors_program() -> None:
    # vision.md 0.3: gamma 1.95, 0.2 to 104.4 cd/m^2, nothing reflected, at most 36.14 cpd.
    display = load_display("varjo-xr3")
    assert (display.gamma, display.black_level, display.peak_luminance) == (1.95, 0.2, 104.4)
    assert display.reflected_luminance == 0
    assert display.nyquist_frequency == pytest.approx(36.14)


def test_the_power_model_is_the_papers() -> None:
    model = load_power_model("surace2025")
    assert (model.power_per_luminance, model.base_power) == (0.001858, 0.2945)


def test_the_default_contrast_model_is_the_one_of_the_code() -> None:
    assert load_contrast_model("default") == DEFAULT_MODEL


def test_each_measure_is_a_contrast_model_of_its_name_and_relative_the_default() -> None:
    assert load_contrast_model("relative") == DEFAULT_MODEL
    assert set(preset_names("contrast_model")) == {*MEASURES, "default", "as-printed"}
    assert {name: load_contrast_model(name) for name in MEASURES} == MEASURES


def test_as_printed_counts_positive_contrast_alone() -> None:
    assert load_contrast_model("as-printed").visibility is Visibility.POSITIVE_ONLY


def test_the_rate_limit_belongs_to_the_display() -> None:
    assert load_rate_limit("surace2025").display_fingerprint == load_display("varjo-xr3").fingerprint


@pytest.mark.parametrize("kind", ["display", "power", "rate_limit", "contrast_model"])
def test_there_is_a_preset_of_every_kind(kind) -> None:
    assert preset_names(kind)


def test_a_name_that_is_none_is_answered_with_the_known_ones() -> None:
    with pytest.raises(InputError, match=r"no such contrast model.*did you mean 'as-printed'\?.*default"):
        load_contrast_model("as_printed")
