"""What a notebook's user does with displays and rate limits, each in a line or two."""

import dataclasses
from pathlib import Path

import pytest

import evenlight


def test_a_display_is_shown_saved_and_read_back(tmp_path: Path) -> None:
    display = dataclasses.replace(evenlight.load_display("laptop-lcd"), name="my laptop <1>")
    page = display._repr_html_()
    assert "Display my laptop &lt;1&gt;" in page
    assert "<td>peak_luminance_cd_m2</td><td>395.0</td>" in page
    display.save(tmp_path / "own.toml")
    assert evenlight.load_display(tmp_path / "own.toml") == display
    with pytest.raises(evenlight.InputError, match="is there already"):
        display.save(tmp_path / "own.toml")
    with pytest.raises(evenlight.InputError, match=r"must end in \.toml"):
        display.save(tmp_path / "own.json")


def test_a_rate_limit_is_shown_with_its_band() -> None:
    limit = evenlight.load_rate_limit("surace2025")
    page = limit._repr_html_()
    low, high = limit.luminance_range
    for luminance, rate in ((low, limit.band_lower[0]), (high, limit.band_lower[-1])):
        assert f"<td>{luminance:.3g}</td><td>{float(limit(luminance)):.3g}</td><td>{rate:.3g} to " in page
    one = evenlight.RateLimit("flat", "d", "", evenlight.RateLimitForm.RATE, (2.0,), (10.0, 10.0))
    assert one._repr_html_().count("<tr>") == 2
    assert "<td>10</td><td>2</td></tr>" in one._repr_html_()
