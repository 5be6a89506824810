"""A session in a language that does not come along: its pages, its font, and what the record says of them."""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
from blind_sessions import SMALL, arguments, written
from PIL import Image, features

from evenlight.data_schema.recordings.dataset_layout import EVENTS, MANIFEST

HEBREW = "# שלום\n\nלחצו {proceed} להמשך, או {pause} להפסקה. הניסוי נמשך {minutes} דקות.\n"
FONT = Path(matplotlib.get_data_path()) / "fonts/ttf/DejaVuSansMono.ttf"
shaped = pytest.mark.skipif(
    not features.check_feature("fribidi"), reason="FriBidi is missing: on Debian, apt-get install libfribidi0"
)


@pytest.fixture
def pages(tmp_path: Path) -> Path:
    folder = tmp_path / "he"
    folder.mkdir()
    (folder / "consent.txt").write_text(HEBREW, encoding="utf-8")
    (folder / "keys.toml").write_text('space = "רווח"\n', encoding="utf-8")
    return folder


def words(tmp_path: Path, *more: object) -> list[object]:
    return [*arguments(tmp_path / "lab", written(SMALL, tmp_path)), *more]


def manifest(tmp_path: Path) -> dict[str, Any]:
    return dict(json.loads((tmp_path / "lab/sub-01/ses-01" / MANIFEST).read_text()))


def test_the_manifest_has_the_digests_of_pages_and_font(
    command: Callable[..., Any], tmp_path: Path, pages: Path
) -> None:
    ended = command(*words(tmp_path, "--pages", pages, "--font", FONT))
    assert (ended.code, ended.err) == (0, "")
    recorded = manifest(tmp_path)["pages"]
    assert recorded["font"] == hashlib.sha256(FONT.read_bytes()).hexdigest()
    assert recorded["consent"] == hashlib.sha256(HEBREW.encode()).hexdigest()
    assert command("validate", tmp_path / "lab").code == 0


def test_a_session_resumed_with_another_font_says_so(command: Callable[..., Any], tmp_path: Path) -> None:
    assert command(*words(tmp_path, "--font", FONT)).code == 0
    path = tmp_path / "lab/sub-01/ses-01" / MANIFEST
    path.write_text(path.read_text().replace('"complete"', '"aborted"'))
    trials = path.with_name("trials.jsonl")
    trials.write_text("".join(trials.read_text().splitlines(keepends=True)[:6]))
    other = FONT.with_name("DejaVuSerif.ttf")
    assert command(*words(tmp_path, "--font", other, "--resume")).code == 0
    events = [json.loads(line) for line in path.with_name(EVENTS).read_text().splitlines()]
    (changed,) = (json.loads(event["detail"]) for event in events if event["kind"] == "changed")
    assert changed == {"page font": hashlib.sha256(other.read_bytes()).hexdigest()}


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("missing.ttf", "no such file; expected a font"),
        ("consent.txt", "cannot be read; expected a font file"),
    ],
)
def test_what_is_no_font_is_refused_before_anything_is_written(
    command: Callable[..., Any], tmp_path: Path, pages: Path, name: str, says: str
) -> None:
    ended = command(*words(tmp_path, "--font", pages / name))
    assert ended.code == 2
    assert f"{name}: {says}" in ended.err
    assert not (tmp_path / "lab").exists()


def test_a_sweep_has_no_pages_and_no_font(command: Callable[..., Any], tmp_path: Path) -> None:
    ended = command(
        "run", "luminance-sweep", "--session", "01", "--rig", "simulated", "--simulate", "data",
        "--font", FONT, "--out", tmp_path / "lab",
    )  # fmt: skip
    assert (ended.code, "--font is for sessions with people" in ended.err) == (2, True)


@shaped
def test_a_session_from_right_to_left_is_shown_and_one_without_its_letters_refused(
    tmp_path: Path, pages: Path, small_rig: Path, laboratory: Callable[..., Any],
    virtual_screen: Callable[..., str],
) -> None:  # fmt: skip
    lab = laboratory(tmp_path, "ramp", SMALL, virtual_screen(), "--rig", small_rig, "--pages", pages)
    lab.run("hebrew", "--screenshots", tmp_path / "seen", "--quiet")
    page = np.asarray(Image.open(tmp_path / "seen" / "page-שלום.png").convert("L")).astype(int)
    inked = np.abs(page - np.median(page)) > 50
    title = inked[: np.flatnonzero(inked.any(axis=1))[0] + 12]  # its first rows
    right_ends = [np.flatnonzero(part.any(axis=0))[-1] for part in (title, inked)]
    assert right_ends[0] == pytest.approx(right_ends[1], abs=4)  # it begins where the other lines do
    (pages / "end.txt").write_text("終わりです。{proceed}\n", encoding="utf-8")
    refused = lab.start("japanese", "--quiet")
    out, err = refused.communicate(timeout=200)
    assert refused.returncode == 2
    assert "'終' (U+7D42" in err
    assert "give a font file that has it as --font" in err
    assert err.count("\n") == 1
    assert not (tmp_path / "japanese").exists()
    assert out == ""
