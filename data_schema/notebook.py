"""How records look in a notebook: a heading, a small table and a small plot."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from evenlight.data_schema.display import Display
    from evenlight.data_schema.rate_limit import RateLimit

WIDE, HIGH = 260, 130  # of what is drawn [px]
LEFT, ABOVE, FOOT = 60, 30, 40  # around it, for words
DIMMED = (1.0, 0.5, 0.2)  # factors at which a display is drawn
Points = Sequence[tuple[float, float]]


def html_table(heading: str, rows: Iterable[Sequence[str]]) -> str:
    """Return a heading and a table, whose first row holds the names of the columns, as HTML.

    >>> html_table("<a>", [["x"], ["1"]])
    '<p><strong>&lt;a&gt;</strong></p><table><tr><th>x</th></tr><tr><td>1</td></tr></table>'
    """
    names, *others = rows
    lines = [f"<tr>{_cells('th', names)}</tr>", *(f"<tr>{_cells('td', row)}</tr>" for row in others)]
    return f"<p><strong>{escape(heading)}</strong></p><table>{''.join(lines)}</table>"


def _cells(kind: str, words: Sequence[str]) -> str:
    return "".join(f"<{kind}>{escape(word)}</{kind}>" for word in words)


def html_plot(axes: tuple[str, str], curves: Mapping[str, Points], band: Points = ()) -> str:
    """Return curves with their names at their ends, and an area, as SVG: x from end to end, y from 0 on.

    >>> html_plot(("x", "y"), {"a": [(1, 0), (3, 2)]}).count('points="60.0,160.0 320.0,30.0"')
    1
    """
    x, y = zip(*itertools.chain(band, *curves.values()), strict=True)
    low, high, top = min(x), max(x), max(y)

    def placed(points: Points) -> list[str]:
        return [
            f"{LEFT + WIDE * (x - low) / (high - low):.1f},{ABOVE + HIGH * (1 - y / top):.1f}"
            for x, y in points
        ]

    def text(x: float, y: float, words: str, anchor: str) -> str:
        return f'<text x="{x}" y="{y}" text-anchor="{anchor}">{escape(words)}</text>'

    floor, right = ABOVE + HIGH, LEFT + WIDE
    parts = [f'<polygon points="{" ".join(placed(band))}" fill-opacity="0.2"/>']
    for name, points in curves.items():
        drawn = placed(points)
        end = float(drawn[-1].partition(",")[2])
        parts += [
            f'<polyline points="{" ".join(drawn)}" fill="none" stroke="currentColor"/>',
            text(right + 4, end + 4, name, "start"),
        ]
    parts += [
        f'<path d="M{LEFT},{ABOVE}V{floor}H{right}" fill="none" stroke="currentColor"/>',
        text(8, ABOVE - 12, axes[1], "start"),
        text(LEFT - 4, ABOVE + 8, f"{top:.4g}", "end"),
        text(LEFT - 4, floor, "0", "end"),
        text(LEFT, floor + 15, f"{low:.4g}", "middle"),
        text(right, floor + 15, f"{high:.4g}", "middle"),
        text(LEFT + WIDE / 2, floor + 32, axes[0], "middle"),
    ]
    size = f'width="{right + 100}" height="{floor + FOOT}" font-size="12" font-family="sans-serif"'
    style = f'style="fill: currentColor" role="img" aria-label="{escape(" over ".join(axes[::-1]))}"'
    return f"<svg {size} {style}>{''.join(parts)}</svg>"


def limit_html(limit: RateLimit) -> str:
    """Return a rate limit at five of the luminances that were measured, with its band, and its curve."""
    import numpy as np

    known, lower, upper = limit.band_luminance, limit.band_lower, limit.band_upper
    columns = ["luminance [cd/m²]", "limit [cd/m²/s]", *([limit.band_words] if known else [])]
    rows = []
    for at in np.unique(np.geomspace(*limit.luminance_range, 5).round(9)).tolist():  # of one luminance: one
        edges = [np.interp(at, known, edge) for edge in (lower, upper) if edge]
        band = [" to ".join(f"{edge:.3g}" for edge in edges)] if edges else []
        rows.append([f"{at:.3g}", f"{float(limit(at)):.3g}", *band])
    simulated = ", of simulated participants" if limit.simulated else ""
    what = f"Rate limit {limit.name}, on {limit.display_name}: {limit.at_limit_in_words}{simulated}"
    table = html_table(what, [columns, *rows])
    if len(rows) == 1:
        return table
    x = np.linspace(*limit.luminance_range, 81).tolist()
    curve = list(zip(x, limit(x).tolist(), strict=True))
    around = [*zip(known, lower, strict=True), *zip(known[::-1], upper[::-1], strict=True)]
    return table + html_plot((columns[0], ", ".join(columns[1:])), {"limit": curve}, around)


def display_facts(display: Display) -> dict[str, str]:
    """Return what is known of a display as a device, by heading; empty where it is not."""
    across, size = display.resolution, display.size
    seen = "" if display.viewing_distance is None else f"{display.viewing_distance:g} m"
    if display.field_of_view is not None:
        seen = f"{display.field_of_view:g}° wide"
    return {
        "name": display.name,
        "device": display.device,
        "pixels": "" if across is None else f"{across[0]} x {across[1]}",
        "size [mm]": "" if size is None else f"{size[0]:.0f} x {size[1]:.0f}",
        "seen from": seen,
        "pixels/°": f"{display.pixels_per_degree:.3g}",
        "cd/m²": f"{display.peak_luminance:.4g}, {display.black_level:.2g}",
        "dimmed by": display.actuator.value if display.actuator else "",
        "power model": display.power_model or "none",
        "gamma": f"{display.gamma:g}",
        "panel": display.panel.value if display.panel else "",
        "measured": display.measured,
        "source": display.source,
    }


def display_html(display: Display) -> str:
    """Return what is known of a display, and the light that it gives at three brightness factors."""
    rows = [[heading, said or "not known"] for heading, said in display_facts(display).items()]
    black, peak, reflected = display.black_level, display.peak_luminance, display.reflected_luminance
    emitted = [(k / 40, (peak - black) * (k / 40) ** display.gamma + black) for k in range(41)]  # Eq. 1
    curves = {f"factor {b:g}": [(at, b * light + reflected) for at, light in emitted] for b in DIMMED}
    axes = ("pixel value", "luminance [cd/m²]")
    return html_table(repr(display)[1:-1], rows) + html_plot(axes, curves)
