"""A report in a real browser: whole tables and whole words, wide or narrow, light or dark."""

import io
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from browser_pages import Browser, browser_session
from PIL import Image
from report_pages import BROKEN_WORDS, faults_at

from evenlight.analysis.figure_style import new_figure, png_bytes
from evenlight.analysis.report import Picture, Report, Section, Table, write_report

# The widest tables of `reproduce`, `analyze` and `fit`: their columns and their widest rows.
KEPT = {
    "pairs": (
        "locations | the track first | baseline first | not known | hazard ratio | 95 % CI | p | exact p | "
        "rings found | 95 % CI | p | exact p | remark",
        "brightened | 173 | 181 | 3 | 1.50 | 0.93 to 2.41 | 0.73 | 0.096 | +2.0 % | -14.0 to +9.6 % | "
        "0.59 | 0.77 | in no pair was the ring found in one version alone: the data give no interval",
    ),
    "quality": (
        "sequence | origin | it is | constant: mean | SEM | the track: mean | SEM | the track - constant | "
        "95 % CI | p, exact | Holm | the track chosen [%] | 95 % CI",
        "Living room | simulated | circular | 4.35 | 0.15 | 4.18 | 0.23 | -0.18 | -0.60 to 0.23 | 0.56 | "
        "1 | 47 | 23 to 72",
    ),
    "tests": (
        "sequence | p | Holm | mid-p | p, ranks | p, signs | pairs that differ | rank-biserial | remark",
        "all (participants' means) | 0.56 | 1 | 0.41 | 0.56 | 1 | 14 of 17 | -0.16 | "
        "only 5 of 17 pairs differ: p cannot come below 0.0625",
    ),
    "thresholds": (
        "participant | screen | b | L [cd/m²] | threshold [cd/m²/s] | 95 % credible interval | at d′ = 1 | "
        "ramps | deviance | p | flag",
        *20
        * (
            "01 | white | 1 | 104 | 0.0723 | 0.0484 to 0.109 | 0.0401 | 48 | 14.1 | < 0.01 | poor fit",
            "01 | white | 0.8 | 83.5 | 2.09 | 1.58 to 2.89 | 1.36 | 48 | 1.7 | 0.98 | –",
            "01 | gray | 0.4 | 9.25 | 0.204 | 0.146 to 0.295 | 0.125 | 48 | 4.6 | 0.54 | –",
        ),
    ),
    "times": (" | ratio | 95 % CI", "second half / first half | 0.97 | 0.89 to 1.06"),
    "inputs": (
        "result | input | SHA-256",
        "reproduction | contrast_model | ab5646c0de79b0afbb701278cc58806716a2a426a5777e109f20724fa6dea764",
    ),
    "files": (
        "file | holds",
        "figures/brightness_and_contrast_loss.png, brightness_and_contrast_loss_points.csv | Loss over time.",
    ),
}
TABLES = {
    name: Table(
        f"What {name} tell.", tuple(head.split(" | ")), tuple(tuple(row.split(" | ")) for row in rows)
    )
    for name, (head, *rows) in KEPT.items()
}


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with browser_session() as session:
        yield session


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    picture = Picture(png_bytes(new_figure(height=1)), "An empty figure.")
    titles = {name: f"What the simulated viewers reproduce of the paper: {name}" for name in TABLES}
    sections = (
        Section(
            titles[name],
            ("Said in `docs/validity.md`.",),
            (table,),
            (picture,),
            ("Of few.",),
            True,
            below=k == 2,
        )
        for k, (name, table) in enumerate(TABLES.items())
    )
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(path, Report("Reproduced", "Less.", tuple(sections), banner="A quick run"))
    return path


@pytest.fixture
def page(browser: Browser, report: Path) -> Browser:
    browser.prefer("light")
    browser.resize(1100)
    browser.open(report)
    return browser


def table_of(page: Browser, name: str) -> str:
    """Return the JavaScript that finds a table."""
    assert page.run("return document.querySelectorAll('table').length") == len(TABLES)
    return f"document.querySelectorAll('table')[{list(TABLES).index(name)}]"


@pytest.mark.parametrize("width", [1440, 1100, 760, 360])
def test_no_table_is_clipped_and_no_word_broken(page: Browser, width: int) -> None:
    assert faults_at(page, width) == []
    assert page.errors() == []


def test_a_word_that_is_broken_would_be_found(page: Browser) -> None:
    page.run("document.head.append(Object.assign(document.createElement('style'), {textContent: "
             "'td { word-break: break-all; max-width: 2ch }'}))")  # fmt: skip
    assert "simulated" in page.run(BROKEN_WORDS)


def edge(page: Browser, name: str) -> float:
    """Return the mean brightness of the strip at the right end of a table, 0 to 255."""
    box = page.run(f"const d = {table_of(page, name)}.closest('div'); d.scrollIntoView({{block: 'center'}}); "
                   "const b = d.getBoundingClientRect(); return [b.right, b.bottom]")  # fmt: skip
    right, bottom = (int(value) for value in box)
    shot = Image.open(io.BytesIO(page.driver.get_screenshot_as_png())).convert("L")
    strip = shot.crop((right - 6, bottom - 12, right - 2, bottom - 4))
    return float(np.asarray(strip).mean())


def test_a_table_that_scrolls_shows_it(page: Browser) -> None:
    assert edge(page, "quality") > 250
    page.resize(360)
    assert edge(page, "quality") < 215
    page.run(f"{table_of(page, 'quality')}.closest('div').scrollLeft = 9999")
    assert edge(page, "quality") > 250


def test_the_header_of_a_long_table_stays(page: Browser) -> None:
    gaps = page.run(f"""const table = {table_of(page, "thresholds")}, box = table.closest('div');
        box.scrollTop = 500;
        return [box.scrollTop, table.tHead.getBoundingClientRect().top - box.getBoundingClientRect().top]""")
    assert gaps == [500, pytest.approx(0, abs=1)]


def test_links_of_the_contents_show_their_section_below_the_banner(page: Browser) -> None:
    links = page.run("return [...document.querySelectorAll('nav a')]")
    assert len(links) == len(TABLES) - 1  # one section belongs to that before it
    for link in links:
        page.run("arguments[0].click()", link)
        top, low = page.run("""const box = of => document.querySelector(of).getBoundingClientRect();
            return [box(location.hash + ' h2').top - box('.banner').bottom, innerHeight]""")
        assert 0 <= top < low


def test_readers_who_do_not_see_it_find_their_way(page: Browser) -> None:
    assert page.run("return document.querySelectorAll('main, nav[aria-label=Contents]').length") == 2
    assert page.run("return [...document.querySelectorAll('table')].every(t => t.caption.textContent)")
    assert page.run("return [...document.querySelectorAll('img')].every(i => i.alt)")
    assert (
        page.run("return [...document.querySelectorAll('th')].filter(h => !h.scope || !h.textContent)") == []
    )
    names = page.run(f"return {table_of(page, 'pairs')}.querySelector('[scope=row]').textContent")
    assert names == "brightened"
    levels = [
        int(n) for n in page.run("return [...document.querySelectorAll('h1, h2, h3')].map(h => h.tagName[1])")
    ]
    assert levels[:2] == [1, 2]
    assert all(after - before <= 1 for before, after in pairwise(levels))
    page.run("document.querySelector('.skip').focus()")
    assert page.run("return document.querySelector('.skip').getBoundingClientRect().top") >= 0


# Relative luminance of the page, then contrast ratios of its texts (WCAG 2.2, 1.4.3).
CONTRAST = """
const linear = v => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
const light = rgb => { const [r, g, b] = rgb.match(/[0-9.]+/g).map(v => linear(v / 255));
  return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
const ground = e => { const c = getComputedStyle(e).backgroundColor;
  return c === 'rgba(0, 0, 0, 0)' && e.parentElement ? ground(e.parentElement) : c; };
const texts = document.querySelectorAll('h1, h2, h3, p, a, span, td, th, caption, figcaption');
return [light(ground(document.body)), ...[...texts].map(e => {
  const pair = [light(getComputedStyle(e).color), light(ground(e))];
  return (Math.max(...pair) + 0.05) / (Math.min(...pair) + 0.05); })];
"""


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_stands_out_in_the_theme_that_is_asked_for(page: Browser, scheme: str) -> None:
    page.prefer(scheme)
    ground, *ratios = page.run(CONTRAST)
    assert (ground < 0.05) == (scheme == "dark")
    assert min(ratios) >= 4.5


def test_a_dark_page_is_printed_on_white(page: Browser) -> None:
    dark = {"media": "print", "features": [{"name": "prefers-color-scheme", "value": "dark"}]}
    page.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", dark)
    ground, *ratios = page.run(CONTRAST)
    page.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": []})
    assert ground == 1
    assert min(ratios) >= 4.5
