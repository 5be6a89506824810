"""README and docs hold together: links, pictures, menu, length of sentences, lines that compute."""

import json
import os
import re
import subprocess
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser_pages import browser_session
from document_text import anchors, fences, links, pages, sentences, word_count

import evenlight

ROOT = Path(evenlight.__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [*pages(ROOT), *(ROOT / name for name in ("CONTRIBUTING.md", "SECURITY.md"))]
GENERATED = ("api.md", "data-dictionary.md", "benchmarks.md")
LONGEST_SENTENCE = 45  # words
LONGEST_README = 150  # lines
# Sentences that newcomers could not follow, each in the few words by which it was known.
RIDDLES = (
    "0 holds still", "more is more", "nothing known of the frames", "nobody being able to tell",
    "not to be had",
)  # fmt: skip


def test_every_link_leads_to_a_file_and_a_heading() -> None:
    for page in (*PAGES, ROOT / "CHANGELOG.md"):
        for _, words, target in links(page.read_text()):
            name, _, anchor = target.partition("#")
            there = (page.parent / name).resolve() if name else page
            assert there.exists(), f"{page}: {words!r} points to {target}"
            assert not anchor or anchor in anchors(there.read_text()), f"{page}: {words!r} points to {target}"


def test_every_decision_that_the_code_names_is_a_page() -> None:
    named: set[str] = set()
    for pattern in ("[a-z]*/**/*.py", "[a-z]*/**/*.txt", "*.toml", "*.txt", "*.sh"):
        for path in ROOT.glob(pattern):
            named |= set(re.findall(r"decisions/([a-z0-9-]+)\.md", path.read_text()))
    assert len(named) > 20
    assert named <= {page.stem for page in (DOCS / "decisions").glob("*.md")}


def test_every_picture_is_described() -> None:
    for page in PAGES:
        for is_picture, words, target in links(page.read_text()):
            assert not is_picture or words.strip(), f"{page}: {target} has no words in its place"


def test_every_fenced_block_has_a_language_or_is_a_command() -> None:
    for page in PAGES:
        for language, first in fences(page.read_text()):
            assert language or first.startswith("evenlight "), f"{page}: the block that begins {first!r}"


def test_every_picture_is_used() -> None:
    shown = {
        (page.parent / target).resolve()
        for page in PAGES
        for is_picture, _, target in links(page.read_text())
        if is_picture
    }
    assert shown == set(DOCS.rglob("*.png"))


def test_the_menu_of_the_site_has_every_page_once() -> None:
    _, menu = (ROOT / "mkdocs.yml").read_text().split("\nnav:\n")
    in_menu = re.findall(r"(\S+\.md)$", menu, flags=re.MULTILINE)
    assert sorted(in_menu) == sorted(str(page.relative_to(DOCS)) for page in DOCS.rglob("*.md"))


def test_no_sentence_is_too_long() -> None:
    for page in PAGES:
        if page.name not in GENERATED:
            for sentence in sentences(page.read_text()):
                assert word_count(sentence) <= LONGEST_SENTENCE, f"{page}: {sentence}"


def test_the_length_of_a_sentence_is_counted() -> None:
    text = """# A heading of four words

    a command, which counts nothing at all, however long it is

One two, [three](four.md) `five six`. Seven (eight) nine!

- An item
  of five words
- another

| two cells | and three words |
|---|---|
"""
    assert [word_count(s) for s in sentences(text)] == [5, 4, 3, 5, 1, 2, 3]


def test_the_readme_is_short() -> None:
    assert (ROOT / "README.md").read_text().count("\n") <= LONGEST_README


@pytest.mark.parametrize("pattern", ["*.md", "docs/**/*.md", "[a-z]*/**/*.py", "analysis/prose/*.txt"])
def test_no_document_help_or_report_speaks_in_riddles(pattern: str) -> None:
    files = [path for path in ROOT.glob(pattern) if path != Path(__file__) and path.name != "CHANGELOG.md"]
    assert files
    for path in files:
        flat = " ".join(re.sub(r'"\s+"', "", path.read_text()).split()).lower()
        for riddle in RIDDLES:
            assert riddle not in flat, f"{path}: {riddle}"


def test_the_version_to_cite_is_that_of_the_software() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text()
    assert f"version {version}." in (DOCS / "citing.md").read_text()


def test_the_lines_of_python_for_a_program_of_ones_own_dim_as_the_formulas_say(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At gamma 2 all numbers are by hand: half of a light of 0.64 is 0.32; of the value 0.8, sqrt(1/2)."""
    exported = {"times_s": [0.0, 0.5], "factors": [1.0, 0.5], "gamma": 2.0}
    (tmp_path / "film.exported_track.json").write_text(json.dumps(exported))
    monkeypatch.chdir(tmp_path)
    section = (DOCS / "using-a-track.md").read_text().split("## In your own program")[1].split("\n## ")[0]
    given: dict[str, Any] = {}
    for block in re.findall(r"```python\n(.*?)```", section, flags=re.DOTALL):
        exec(compile(block, "using-a-track.md", "exec"), given)  # the page's own lines
    dimmed, like_a_backlight = given["dimmed"], given["like_a_backlight"]
    values = np.array([0.0, 0.8, 1.0])
    np.testing.assert_array_equal(dimmed(values, 0.49), values)
    np.testing.assert_allclose(dimmed(values, 0.5), [0, 0.8 * 0.5**0.5, 0.5**0.5], rtol=1e-12)
    np.testing.assert_array_equal(dimmed(values, -1.0), values)
    np.testing.assert_allclose(dimmed(values, 9.0) ** 2, 0.5 * values**2, rtol=1e-12)
    # L = 1 + 99 v^2: 1, 64.36 and 100; halved 0.5 (below black: code 0), 32.18 and 50.
    shown = like_a_backlight(values, 0.5, gamma=2.0, peak=100.0, black=1.0)
    np.testing.assert_allclose(shown**2, [0, 31.18 / 99, 49 / 99], rtol=1e-12)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the site as `make docs` does, where a warning is an error."""
    if find_spec("mkdocs") is None or find_spec("nbclient") is None:
        pytest.skip("the site needs mkdocs-material and nbclient: pip install 'evenlight[docs]'")
    folder = tmp_path_factory.mktemp("site")
    built = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)],
        cwd=ROOT, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"}, capture_output=True, text=True, timeout=600,
        check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stdout + built.stderr
    return folder


@pytest.mark.slow
def test_the_site_loads_nothing_from_the_network(site: Path) -> None:
    pages_of_site = list(site.rglob("*.html"))
    assert site / "guides" / "engineer.html" in pages_of_site
    for page in pages_of_site:
        text = page.read_text()
        loaded = re.findall(r"<(?:script|img|iframe)\b[^>]*?\ssrc=\"?([^\" >]+)", text)
        loaded += [
            address
            for link in re.findall(r"<link\b[^>]+>", text)
            if re.search(r"rel=\"?(stylesheet|preconnect|icon)", link)
            for address in re.findall(r"href=\"?([^\" >]+)", link)
        ]
        assert loaded
        assert not [address for address in loaded if "//" in address.partition(";base64,")[0]], page
    for sheet in site.rglob("*.css"):
        assert not re.search(r"(@import|url\()\s*[\"']?https?:", sheet.read_text()), sheet


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "first"),
    [("film-track", "Track of"), ("rate-limit", "RampFit of 8 simulated"), ("rating-study", "Analysis of")],
)
def test_a_notebook_is_a_page_with_what_its_cells_show(site: Path, name: str, first: str) -> None:
    """They are run when the site is built; what they showed once is not kept beside them."""
    kept = json.loads((ROOT / "examples" / "notebooks" / f"{name}.ipynb").read_text())
    assert not any(cell.get("outputs") for cell in kept["cells"])
    page = (site / "notebooks" / f"{name}.html").read_text()
    shown = [page.count(what) for what in (f"<strong>{first}", "data:image/png;base64,", "simulated")]
    assert min(shown) > 0, shown


@pytest.mark.slow
def test_the_site_is_searched_from_the_disk(site: Path) -> None:
    """A browser starts no worker for a page without a server: `iframe-worker.js` takes its place."""
    with browser_session() as browser:
        browser.driver.get((site / "decisions" / "rate-constraint.html").as_uri() + "?q=modulation")
        found = browser.wait_for(
            lambda: re.match(
                r"(\d+) matching",
                browser.run("return document.querySelector('.md-search-result__meta').innerText"),
            )
        )
        assert int(found[1]) > 5
        assert browser.errors() == []
