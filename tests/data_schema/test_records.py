"""Records: their limits, and the way to a file and back."""

from pathlib import Path

import pytest

from data_schema.display import Display
from data_schema.errors import InputError
from data_schema.text_files import read_toml_record, write_toml_record


def test_a_display_survives_toml(tmp_path: Path) -> None:
    display = Display("bench", 104.4, 0.2, 1.95, 72.28, source="a meter")
    write_toml_record(tmp_path / "d.toml", display)
    assert read_toml_record(Display, tmp_path / "d.toml") == display


def test_a_misspelt_key_is_named_with_the_right_one(tmp_path: Path) -> None:
    file = tmp_path / "d.toml"
    file.write_text(
        'name = "x"\npeak_luminance_cd_m2 = 100\nblack_level_cd_m2 = 0.1\n'
        "gama = 2.2\npixels_per_degree = 30\n"
    )
    with pytest.raises(InputError, match=r"d\.toml: unknown key 'gama'.*did you mean 'gamma'"):
        read_toml_record(Display, file)


def test_a_limit_names_quantity_unit_and_value() -> None:
    with pytest.raises(ValueError, match=r"peak_luminance_cd_m2 must be above 0 cd/m\^2, got -1"):
        Display("x", -1.0, 0.0, 2.2, 30.0)
