"""What a notebook's user does with displays and rate limits, each in a line or two."""

import dataclasses
import re
from pathlib import Path

import pytest

import evenlight


def curves_of(page: str) -> list[tuple[str, list[tuple[float, float]]]]:
    """Return the names of drawn curves, and their points [px]: x from 60 to 320, y from 160 (0) to 30."""
    found = re.findall(r'<polyline points="([^"]*)"[^>]*/><text[^>]*>([^<]*)<', page)
    pairs = ((name, [point.split(",") for point in points.split()]) for points, name in found)
    return [(name, [(float(x), float(y)) for x, y in points]) for name, points in pairs]


def test_a_display_is_shown_saved_and_read_back(tmp_path: Path) -> None:
    display = dataclasses.replace(evenlight.load_display("laptop-lcd"), name="my laptop <1>")
    page = display._repr_html_()
    assert "Display &#x27;my laptop &lt;1&gt;&#x27;: 0.2324 to 395 cd/m^2, gamma 2.2" in page
    told = dict(re.findall("<t[dh]>([^<]*)</t[dh]><t[dh]>([^<]*)</t[dh]>", page))
    assert (told["size [mm]"], told["seen from"], told["dimmed by"]) == ("302 x 188", "0.5 m", "backlight")
    assert (told["panel"], told["power model"], told["cd/m²"]) == ("lcd", "none", "395, 0.23")
    assert "assumed: gamma 2.2 (sRGB), seen from 0.5 m" in told["source"]
    assert [name for name, _ in curves_of(page)] == ["factor 1", "factor 0.5", "factor 0.2"]
    whole, half, _ = (points for _, points in curves_of(page))
    assert whole[-1] == (320.0, 30.0)  # white at factor 1: right and top
    assert whole[20][1] == pytest.approx(160 - 130 * (0.5**2.2 + 0.2324 / 395), abs=0.1)
    assert [160 - y for _, y in half] == pytest.approx([(160 - y) / 2 for _, y in whole], abs=0.1)
    display.save(tmp_path / "own.toml")
    assert evenlight.load_display(tmp_path / "own.toml") == evenlight.load(tmp_path / "own.toml") == display
    with pytest.raises(evenlight.InputError, match="is there already"):
        display.save(tmp_path / "own.toml")
    with pytest.raises(evenlight.InputError, match=r"must end in \.toml"):
        display.save(tmp_path / "own.json")
    with pytest.raises(evenlight.InputError, match=r"must end in \.json"):
        evenlight.load_rate_limit("surace2025").save(tmp_path / "limit.toml")


def test_a_rate_limit_is_shown_with_its_band() -> None:
    limit = evenlight.load_rate_limit("surace2025")
    page = limit._repr_html_()
    low, high = limit.luminance_range
    for luminance, rate in ((low, limit.band_lower[0]), (high, limit.band_lower[-1])):
        assert f"<td>{luminance:.3g}</td><td>{float(limit(luminance)):.3g}</td><td>{rate:.3g} to " in page
    ((name, points),) = curves_of(page)
    assert (name, points[0][0], points[-1][0]) == ("limit", 60.0, 320.0)
    share = float(limit(low) / limit(high))
    assert (160 - points[0][1]) / (160 - points[-1][1]) == pytest.approx(share, abs=0.003)
    assert "limit [cd/m²/s], 95 % pointwise band</text>" in page
    one = evenlight.RateLimit("flat", "d", "", evenlight.RateLimitForm.RATE, (2.0,), (10.0, 10.0))
    assert (one._repr_html_().count("<tr>"), "<svg" in one._repr_html_()) == (2, False)
    assert "<td>10</td><td>2</td></tr>" in one._repr_html_()
