"""The one home of the paper's printed numbers."""

import math
import re
import tomllib
from pathlib import Path

import pytest

from evenlight.analysis.published import SEQUENCES, SURACE_2025, PublishedValue, published, published_values
from evenlight.data_schema.storage.tables import read_rows
from evenlight.method.preset_files import load_display, load_power_model

PLACE = re.compile(r"(Table [1-3]|Equation [1-7]|Figure [0-9]+|Section [1-8](\.[1-5])?|the authors' program)")


def test_every_name_stands_once_and_every_value_has_a_place_in_the_paper() -> None:
    rows = read_rows(PublishedValue, SURACE_2025)
    assert len({row.name for row in rows}) == len(rows) > 100
    for row in rows:
        assert PLACE.match(row.place), row
        assert math.isfinite(row.number)


@pytest.mark.parametrize("sequence", SEQUENCES)
def test_all_three_tables_are_there_for_every_sequence(sequence: str) -> None:
    columns = {
        "detail_quality": ["baseline_mean", "baseline_sem", "ours_mean", "ours_sem", "chosen_percent"],
        "adaptation": ["factor", "constrained", "unconstrained"],
        "power": ["baseline", "ours", "full"],
    }
    for table, names in columns.items():
        assert [v.name for v in published_values(f"{table}.{sequence}")] == [
            f"{table}.{sequence}.{name}" for name in names
        ]


def test_digits_are_kept_as_printed() -> None:
    # 1.800 W says more than 1.8 W.
    assert published("power.library.full").text == "1.800"
    assert published("ramp.initial_factor.5").text == "1.0"


def test_a_prefix_takes_whole_parts_of_names() -> None:
    # "power" is Table 3 alone: neither "power_model" nor "authors_power".
    assert len(published_values("power")) == 12
    assert {v.name for v in published_values("power_model")} == {"power_model.slope", "power_model.base"}
    assert published_values("powe") == ()


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(KeyError, match=r"no value 'power\.attic\.full'"):
        published("power.attic.full")


def test_the_presets_hold_the_published_numbers() -> None:
    power, display = load_power_model("surace2025"), load_display("varjo-xr3")
    assert power.power_per_luminance == published("power_model.slope").number
    assert power.base_power == published("power_model.base").number
    assert power.peak_luminance == published("authors_power.1.luminance").number
    assert display.gamma == published("authors_display.gamma").number
    assert display.peak_luminance == published("authors_display.peak_luminance").number
    assert display.black_level == published("authors_display.black_level").number
    # Twice the highest spatial frequency: two pixels make a cycle.
    assert display.pixels_per_degree == pytest.approx(
        2 * published("authors_display.highest_frequency").number, abs=1e-9
    )


def test_the_table_travels_with_an_installed_package() -> None:
    project = tomllib.loads((Path(SURACE_2025).resolve().parents[2] / "pyproject.toml").read_text())
    assert project["tool"]["setuptools"]["package-data"]["evenlight.analysis"][0] == "published/*.csv"
