"""How records look in a notebook: a heading and a small table."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from evenlight.data_schema.rate_limit import RateLimit


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


def limit_html(limit: RateLimit) -> str:
    """Return a rate limit at five of the luminances that were measured, with its band."""
    import numpy as np

    columns = ["luminance [cd/m²]", "limit [cd/m²/s]", *([limit.band_words] if limit.band_luminance else [])]
    rows = []
    for at in np.unique(np.geomspace(*limit.luminance_range, 5).round(9)).tolist():  # of one luminance: one
        edges = [
            np.interp(at, limit.band_luminance, edge) for edge in (limit.band_lower, limit.band_upper) if edge
        ]
        band = [" to ".join(f"{edge:.3g}" for edge in edges)] if edges else []
        rows.append([f"{at:.3g}", f"{float(limit(at)):.3g}", *band])
    simulated = ", of simulated participants" if limit.simulated else ""
    what = f"Rate limit {limit.name}, on {limit.display_name}: {limit.at_limit_in_words}{simulated}"
    return html_table(what, [columns, *rows])
