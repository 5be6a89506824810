"""Files that hold NaN or infinity: refused where they are read, in one line that names the value.

The naive check, `if value < limit: refuse`, lets NaN pass, because every comparison with it is false.
"""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.tracks.loss_curves import read_loss_curves, write_loss_curves
from evenlight.method.preset_files import PRESETS, load_display, load_power_model, load_rate_limit
from evenlight.stimuli.video.image_folder import open_image_folder

NO_NUMBERS = ("nan", "inf", "-inf")


def passes_naively(value: float) -> bool:
    """A check that a value is not out of bounds."""
    return not (value < 0 or value == math.inf)


def one_line(error: pytest.ExceptionInfo[InputError]) -> str:
    message = str(error.value)
    assert "\n" not in message
    return message


@pytest.mark.parametrize("word", NO_NUMBERS)
def test_displays_and_power_models(tmp_path, word) -> None:
    assert passes_naively(float("nan"))
    for load, preset, key in (
        (load_display, "varjo-xr3.display", "peak_luminance_cd_m2"),
        (load_power_model, "surace2025.power", "base_power_w"),
    ):
        lines = (PRESETS / f"{preset}.toml").read_text().splitlines()
        path = tmp_path / "odd.toml"
        path.write_text("\n".join(f"{key} = {word}" if line.startswith(key) else line for line in lines))
        with pytest.raises(InputError, match=f"odd.toml: {key} must be finite, got {word}") as error:
            load(str(path))
        one_line(error)


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("NaN", "NaN is no number"),
        ("-Infinity", "-Infinity is no number"),
        ("1e999", "must be finite, got inf"),
    ],
)
@pytest.mark.parametrize("key", ["coefficients", "luminance_range_cd_m2", "band_lower_cd_m2_s"])
def test_rate_limits(tmp_path, key, word, said) -> None:
    content = json.loads((PRESETS / "surace2025.rate_limit.json").read_text())
    content[key][0] = 12345.0
    text = json.dumps(content).replace("12345.0", word)
    assert not math.isfinite(json.loads(text)[key][0])  # Python reads them without a word
    path = tmp_path / "odd.json"
    path.write_text(text)
    with pytest.raises(InputError, match=f"odd.json.*{said}") as error:
        load_rate_limit(str(path))
    one_line(error)


@pytest.mark.parametrize("name", ["loss", "durations", "mean_luminance", "channel_means", "factors"])
@pytest.mark.parametrize("word", NO_NUMBERS)
def test_loss_curves(make_curves, tmp_path, name, word) -> None:
    curves = make_curves([0.2, 0.5])
    values = np.array(getattr(curves, name))
    values.flat[1] = float(word)
    with pytest.raises(ValueError, match=f"must be finite, got {word}"):
        replace(curves, **{name: values})
    path = tmp_path / "odd.npz"
    write_loss_curves(path, curves)
    with np.load(path) as content:
        arrays = dict(content) | {name: values}
    np.savez(path, **arrays)
    with pytest.raises(InputError, match=f"odd.npz: {name}.* must be finite, got {word}") as error:
        read_loss_curves(path)
    one_line(error)


@pytest.mark.parametrize("word", NO_NUMBERS)
def test_arrays_of_pixel_values(tmp_path, word) -> None:
    pixels = np.full((8, 8), 0.5)
    pixels[2, 3] = float(word)
    np.save(tmp_path / "frame.npy", pixels)
    with pytest.raises(InputError, match=r"frame.npy holds values that are not finite") as error:
        list(open_image_folder(tmp_path).frames())
    one_line(error)
