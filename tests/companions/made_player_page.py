"""A player page of a made video and track, and what a test does with it in a browser."""

from __future__ import annotations

import base64
import csv
import io
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from browser_pages import Browser
from example_tracks import example_track, header_of
from made_summary import made_summary
from PIL import Image
from selenium.webdriver import ActionChains

from evenlight.analysis.player.player_page import PlayerContent
from evenlight.analysis.player.proxy_video import Proxy, Tiles
from evenlight.analysis.tracks.track_figure import DrawnTrack
from evenlight.data_schema.display import Display
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack

N, WIDTH, HEIGHT, GAMMA, CONSTANT = 40, 96, 64, 1.95, 0.5
NAME = "a <b>film</b> & </script>.mp4"
DISPLAY = Display("made", 100.0, 0.0, GAMMA, 30.0)
STEPS_MS = np.where(np.arange(N) % 4 == 3, 150, 50)  # the rate varies
TIMES = (np.cumsum(STEPS_MS) - STEPS_MS) / 1000
LEVELS = 40 + 5 * np.arange(N)  # grey of each frame, by which it is known
MAPPED = (4, 30)  # frames with a map of lost contrast
STEPS = np.arange(N)
FACTORS = 0.5 + 0.3 * np.sin(STEPS / 6)


def made_track() -> BrightnessTrack:
    """A track with every column of its own shape."""
    header = header_of(DISPLAY, video=NAME, power_model="made", rate_limit="made")
    return example_track(
        FACTORS,
        times=TIMES,
        contrast_loss=0.2 + 0.1 * np.cos(STEPS / 4),
        mean_luminance=10.0,
        rate=np.append(4 * np.diff(FACTORS), 0.0),
        rate_limit=1.5 + 0.3 * np.cos(STEPS / 3),
        power=1 + 0.2 * np.sin(STEPS / 6),
        header=header,
    )


def made_proxy() -> Proxy:
    """Grey frames with a darker stripe on the left, as H.264, at their times."""
    stream = io.BytesIO()
    with av.open(stream, "w", format="mp4") as file:
        video = file.add_stream("libx264", rate=Fraction(20))
        video.width, video.height, video.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        video.time_base = video.codec_context.time_base = Fraction(1, 1000)
        video.options = {"crf": "4", "bf": "0", "g": "8"}
        for number, level in enumerate(LEVELS):
            picture = np.full((HEIGHT, WIDTH, 3), level, np.uint8)
            picture[:, :16] = level // 2
            frame = av.VideoFrame.from_ndarray(picture, "rgb24").reformat(format="yuv420p")
            frame.pts, frame.time_base = round(1000 * TIMES[number]), Fraction(1, 1000)
            file.mux(video.encode(frame))
        file.mux(video.encode(None))
    return Proxy(stream.getvalue(), WIDTH, HEIGHT, TIMES, np.arange(N), 1e6)


def sheet_of(pictures: list[np.ndarray[Any, Any]], kind: str) -> bytes:
    """Pictures beside each other, as a file."""
    stream = io.BytesIO()
    Image.fromarray(np.concatenate(pictures, axis=1).astype(np.uint8)).save(stream, kind)
    return stream.getvalue()


def made_content() -> PlayerContent:
    """A page's content: of the first map the left half is lost with ours, of the second the right half."""
    halves = [np.zeros((4, 8, 3)) for _ in MAPPED]
    halves[0][:, :4, 0] = halves[1][:, 4:, 0] = 255
    contrast = Tiles(sheet_of(halves, "PNG"), 8, 4, 2, np.array(MAPPED))
    summary = made_summary(baseline_factor=CONSTANT)
    data = DrawnTrack(made_track(), summary, 0.3 + 0.05 * np.sin(STEPS / 2))
    return PlayerContent(data, DISPLAY, np.full(N, 1.0), made_proxy(), contrast, ("A made note.",))


def opened(browser: Browser, page: Path) -> None:
    """Open a page and wait for its first picture."""
    browser.open(page)
    settled(browser, 0)


def settled(browser: Browser, frame: int) -> None:
    """Wait until the picture and the numbers are those of a frame."""
    browser.wait_for(
        "return +document.getElementById('frame').textContent === arguments[0] && "
        "[...document.querySelectorAll('figure:not([hidden]) canvas')].every("
        "c => +c.dataset.frame === arguments[0])",
        frame,
    )


def go_to(browser: Browser, frame: int) -> None:
    """Move the page's slider, and wait for the picture."""
    move = "s.value = arguments[0]; s.dispatchEvent(new Event('input'))"
    browser.run(f"const s = document.getElementById('seek'); {move}", frame)
    settled(browser, frame)


def press(browser: Browser, *keys: str) -> None:
    """Press keys one after the other."""
    ActionChains(browser.driver).send_keys(*keys).perform()


def pixels(browser: Browser, version: str) -> np.ndarray[Any, Any]:
    """The picture of a version, (height, width, 3), 0 to 255."""
    script = (
        "return document.querySelector(`[data-version=${arguments[0]}] canvas`).toDataURL().split(',')[1]"
    )
    return np.asarray(
        Image.open(io.BytesIO(base64.b64decode(browser.run(script, version)))).convert("RGB"), float
    )


def text(browser: Browser, selector: str) -> str:
    """The text of an element."""
    return str(browser.run("return document.querySelector(arguments[0]).textContent", selector))


def headings(browser: Browser) -> list[list[float]]:
    """The numbers in the headings of the four panels."""
    words = "[...heading.querySelectorAll('data')].map(d => parseFloat(d.textContent))"
    found = browser.run(f"return [...document.querySelectorAll('#plots h2')].map(heading => {words})")
    return [[float(number) for number in panel] for panel in found]


def rows_of(path: Path) -> list[dict[str, float]]:
    """track.csv as it is read by others."""
    with path.open() as file:
        return [{name: float(cell) for name, cell in row.items()} for row in csv.DictReader(file)]
