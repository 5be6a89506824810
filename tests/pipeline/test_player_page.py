"""The player page in a real browser: it plays, seeks, dims in linear light, and says what track.csv says."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from browser_pages import Browser, browser_session
from made_player_page import (
    CONSTANT,
    FACTORS,
    GAMMA,
    HEIGHT,
    LEVELS,
    NAME,
    TIMES,
    WIDTH,
    N,
    go_to,
    headings,
    made_content,
    opened,
    pixels,
    press,
    rows_of,
    settled,
    sheet_of,
    text,
)
from selenium.webdriver import ActionChains, Keys

from evenlight.analysis.player import player_page
from evenlight.analysis.player.player_page import PlayerContent, player_html, write_player_page
from evenlight.analysis.player.proxy_video import Proxy, Tiles
from evenlight.data_schema.tracks.brightness_track import (
    write_track,
)

SHOWN_CHOICES = """return [...document.querySelectorAll('#picture input:not(#seek), #legend, #notes')]
    .filter(e => e.checkVisibility()).map(e => e.id || e.value).join()"""  # of what to see of the picture

LOADING = "return document.getElementById('loading').checkVisibility()"


@pytest.fixture(scope="module")
def content() -> PlayerContent:
    return made_content()


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with browser_session() as session:
        yield session


@pytest.fixture(scope="module")
def page(content: PlayerContent, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "player.html"
    write_player_page(path, content)
    return path


@pytest.fixture
def player(browser: Browser, page: Path) -> Browser:
    """The page as it is when it opens."""
    if browser.driver.current_url != page.resolve().as_uri():
        opened(browser, page)
    browser.run(
        "document.activeElement.blur(); for (const [id, value] of [['reflected', 0], ['seek', 0]]) {"
        "const e = document.getElementById(id); e.value = value; e.dispatchEvent(new Event('input')); }"
        "const map = document.getElementById('map'); if (map.checked) map.click();"
    )
    away = browser.run("return document.querySelector('h1')")
    ActionChains(browser.driver).move_to_element(away).send_keys("s", "0").perform()
    settled(browser, 0)
    return browser


def test_it_opens_from_a_file_without_complaint_and_loads_nothing_else(player: Browser, page: Path) -> None:
    opened(player, page)
    assert player.errors() == []
    loaded = player.run("return performance.getEntriesByType('resource').map(r => r.name.slice(0, 5))")
    assert set(loaded) <= {"data:", "blob:"}
    assert text(player, "h1").startswith(f"{NAME} on made, mean brightness factor 0.5")
    assert "A made note." in text(player, "#picture")


@pytest.mark.parametrize("frame", [3, 22, 39])
def test_its_pixels_are_factor_times_frame_in_linear_light(player: Browser, frame: int) -> None:
    go_to(player, frame)
    full = pixels(player, "full")
    assert np.abs(full[:, 24:] - LEVELS[frame]).max() <= 2  # it is that frame; apart from the stripe's edge
    for version, factor in (("ours", FACTORS[frame]), ("constant", CONSTANT)):
        by_definition = 255 * (factor * (full / 255) ** GAMMA) ** (1 / GAMMA)
        assert np.abs(pixels(player, version) - by_definition).max() <= 2


@pytest.mark.real_time  # a real Chromium plays
def test_it_plays_and_pauses(player: Browser) -> None:
    press(player, " ")
    player.wait_for("return +document.getElementById('frame').textContent >= 3")
    press(player, " ")
    assert text(player, "#play") == "Play"
    settled(player, int(text(player, "#frame")))
    frame = int(text(player, "#frame"))
    assert np.abs(pixels(player, "full")[:, 24:] - LEVELS[frame]).max() <= 2
    go_to(player, N - 4)
    press(player, " ")
    player.wait_for("return document.getElementById('play').textContent === 'Play'")  # at the end it stops
    settled(player, N - 1)


def test_a_click_on_a_plot_goes_there(player: Browser) -> None:
    over = player.run("return document.querySelectorAll('.u-over')[1]")
    box = player.run("const b = arguments[0].getBoundingClientRect(); return [b.left, b.width]", over)
    end = TIMES[-1] + 0.05  # the last frame lasts as long as most
    for frame, time in ((11, 0.825), (27, 2.025)):  # in the middle of frames of 0.15 s
        at = (time / end - 0.5) * box[1]
        ActionChains(player.driver).move_to_element_with_offset(over, at, 0).perform()
        assert text(player, "#where") == f"{TIMES[frame]:.2f} s, frame {frame}, under the pointer"
        assert headings(player)[0][0] == pytest.approx(FACTORS[frame], abs=0.0005)
        assert text(player, "#frame") != str(frame)
        ActionChains(player.driver).click().perform()
        settled(player, frame)
        marks = player.run("return [...document.querySelectorAll('.now')].map(n => parseFloat(n.style.left))")
        assert marks == pytest.approx([100 * TIMES[frame] / end] * 4, abs=0.01)


def test_its_numbers_are_those_of_track_csv(player: Browser, content: PlayerContent, tmp_path: Path) -> None:
    write_track(tmp_path / "track.csv", content.data.track)
    rows = rows_of(tmp_path / "track.csv")
    for frame in (0, 17, 33):
        go_to(player, frame)
        row, (factor, loss, rate, power) = rows[frame], headings(player)
        assert factor == pytest.approx([row["factor"], CONSTANT], abs=0.0005)
        assert loss == pytest.approx(
            [100 * row["contrast_loss"], 100 * content.data.baseline_loss[frame]], abs=0.005
        )
        assert rate == pytest.approx([100 * row["rate_cd_m2_s"] / row["rate_limit_cd_m2_s"]], abs=0.05)
        assert power == pytest.approx([row["power_w"], 1.0], abs=0.0005)
        assert text(player, "#time") == f"{row['time_s']:.2f} s"


def test_its_lines_are_drawn_where_the_numbers_say(player: Browser) -> None:
    """Rows of the blue line, of which the lowest and the highest give the scale of the axis."""
    script = """const c = document.querySelector('.uplot canvas'), o = document.querySelector('.u-over');
    const left = o.offsetLeft * devicePixelRatio, width = o.offsetWidth * devicePixelRatio;
    return arguments[0].map(share => { const x = Math.round(left + share * width);
      const d = c.getContext('2d').getImageData(x, 0, 1, c.height).data, rows = [];
      for (let y = 0; y < c.height; y++) if (d[4*y+3] > 200 && d[4*y] < 60 && d[4*y+2] > 100) rows.push(y);
      return rows.reduce((a, b) => a + b, 0) / rows.length; })"""
    player.prefer("light")
    frames = [int(np.argmin(FACTORS)), int(np.argmax(FACTORS)), 20, 3, 35]
    middles = (TIMES[frames] + np.append(TIMES, TIMES[-1] + 0.05)[np.array(frames) + 1]) / 2
    low, high, *others = player.run(script, (middles / (TIMES[-1] + 0.05)).tolist())
    assert low > high + 20  # pixels, counted from above
    expected = np.interp(FACTORS[frames[2:]], sorted(FACTORS[frames[:2]]), [low, high])
    assert others == pytest.approx(expected, abs=1.5)


def test_the_keys_do_what_their_list_says(player: Browser) -> None:
    press(player, Keys.ARROW_RIGHT, Keys.ARROW_RIGHT, Keys.ARROW_LEFT)
    settled(player, 1)
    ActionChains(player.driver).key_down(Keys.SHIFT).send_keys(Keys.ARROW_RIGHT).key_up(Keys.SHIFT).perform()
    settled(player, int(np.searchsorted(TIMES, TIMES[1] + 1, side="right") - 1))
    press(player, Keys.END)
    settled(player, N - 1)
    press(player, Keys.HOME)
    settled(player, 0)
    shown = "return [...document.querySelectorAll('figure:not([hidden])')].map(f => f.dataset.version)"
    for key, versions in {
        "1": ["full"],
        "3": ["constant"],
        "2": ["ours"],
        "s": ["full", "ours", "constant"],
    }.items():
        press(player, key)
        assert player.run(shown) == versions
    mark = "return parseFloat(document.querySelector('.now').style.left)"
    go_to(player, 20)
    whole = player.run(mark)
    press(player, "+")
    assert player.run(mark) == pytest.approx(whole, abs=0.1)  # it zooms around the frame of now
    press(player, Keys.HOME)  # out of view: the view follows
    assert player.run(mark) == pytest.approx(0.0)
    press(player, "0", "?")
    assert player.run("return document.getElementById('keys').open")
    press(player, Keys.ESCAPE, "n")
    assert re.match(
        r"0\.00 s, frame 0\. Brightness factor b: track 0\.500, constant 0\.500;", text(player, "#spoken")
    )


def test_dragging_over_a_plot_zooms_and_with_shift_moves(player: Browser) -> None:
    over = player.run("return document.querySelector('.u-over')")
    wide = player.run("return arguments[0].clientWidth", over)
    mark = "return parseFloat(document.querySelector('.now').style.left)"
    go_to(player, 20)
    before = player.run(mark)
    drag = ActionChains(player.driver).move_to_element_with_offset(over, -wide // 4, 0).click_and_hold()
    drag.move_by_offset(wide // 2, 0).release().perform()
    player.wait_for(
        f"return Math.abs(parseFloat(document.querySelector('.now').style.left) - {2 * before - 50}) < 1"
    )
    assert text(player, "#frame") == "20"  # dragging is no click
    zoomed = player.run(mark)
    drag = ActionChains(player.driver).move_to_element(over).key_down(Keys.SHIFT).click_and_hold()
    drag.move_by_offset(wide // 10, 0).release().key_up(Keys.SHIFT).perform()
    assert player.run(mark) == pytest.approx(zoomed + 10, abs=1)


def test_the_divider_parts_one_picture_into_two_versions(player: Browser) -> None:
    go_to(player, 10)
    ours, constant = pixels(player, "ours"), pixels(player, "constant")
    pair = text(player, "#pair")
    press(player, "3", "d")
    assert text(player, "#pair") == pair == "track | constant"  # as was said before, whatever was shown
    divider = player.run("return document.getElementById('divider')")
    assert np.array_equal(pixels(player, "ours"), np.concatenate([ours[:, :48], constant[:, 48:]], axis=1))
    box = player.run("return document.querySelector('[data-version=ours] .screen').clientWidth")
    ActionChains(player.driver).drag_and_drop_by_offset(divider, round(0.25 * box), 0).perform()
    assert np.array_equal(pixels(player, "ours"), np.concatenate([ours[:, :72], constant[:, 72:]], axis=1))
    player.run("arguments[0].focus()", divider)
    press(player, Keys.HOME)
    assert divider.get_attribute("aria-valuenow") == "0"
    assert np.array_equal(pixels(player, "ours"), constant)
    press(player, Keys.ARROW_RIGHT)
    assert divider.get_attribute("aria-valuetext") == "1 % track, 99 % constant"
    press(player, "1")
    assert text(player, "#pair") == "full | track"
    press(player, "2")
    settled(player, 10)  # the arrows moved the divider, not the film


def test_the_map_is_laid_over_the_picture_that_it_is_of(player: Browser) -> None:
    go_to(player, 31)
    plain, full, constant = (pixels(player, version) for version in ("ours", "full", "constant"))
    press(player, "c")
    mapped = pixels(player, "ours")
    assert "frame 30" in text(player, "#legend")
    assert np.array_equal(mapped[:, 16:40], plain[:, 16:40])  # there nothing is lost
    red = mapped[:, 56:] - plain[:, 56:]
    assert (red[..., 0] > 60).all()
    assert (np.abs(mapped[:, 56:] - (0.15 * plain[:, 56:] + 0.85 * np.array([0xF0, 0x43, 0x3A]))) <= 2).all()
    assert np.array_equal(pixels(player, "full"), full)
    assert np.array_equal(pixels(player, "constant"), constant)
    player.run(
        "document.getElementById('previous-map').click()"
    )  # from 31: the one that is shown, then the other
    player.run("document.getElementById('previous-map').click()")
    settled(player, 4)
    first = pixels(player, "ours")
    assert first[:, 20:36, 0].min() > first[:, 60:, 0].max() + 60


def test_light_of_the_room_is_added_to_every_version(player: Browser) -> None:
    go_to(player, 25)
    before = {version: pixels(player, version) for version in ("full", "ours", "constant")}
    script = (
        "const r = document.getElementById('reflected'); r.value = 10; r.dispatchEvent(new Event('input'))"
    )
    player.run(script)
    assert text(player, "#reflected-value") == "10.0 cd/m²"
    for version, shown in before.items():
        light = ((shown / 255) ** GAMMA + 0.1) / 1.1  # 10 of 100 cd/m^2; white still fits
        assert np.abs(pixels(player, version) - 255 * light ** (1 / GAMMA)).max() <= 2


@pytest.mark.parametrize(("width", "scheme"), [(360, "dark"), (1100, "light"), (3840, "dark")])
def test_it_fits_from_a_telephone_to_a_wall_in_both_themes(
    browser: Browser, page: Path, width: int, scheme: str
) -> None:
    try:
        browser.resize(width)
        browser.prefer(scheme)
        opened(browser, page)
        assert browser.overflowing(".unseen") == []
        assert browser.run("return document.documentElement.dataset.theme") == scheme
        assert browser.run("return document.querySelector('.uplot canvas').clientWidth") > 0.9 * width
        browser.run("document.getElementById('theme').click()")
        assert browser.run("return document.documentElement.dataset.theme") != scheme
    finally:
        browser.resize(1100)
        browser.prefer("light")


def test_everything_that_is_operated_has_a_name(player: Browser) -> None:
    nodes = player.driver.execute_cdp_cmd("Accessibility.getFullAXTree", {})["nodes"]
    operated = {"button", "slider", "radio", "checkbox", "image", "img", "region", "DisclosureTriangle"}
    found = [
        (node["role"]["value"], node["name"]["value"])
        for node in nodes
        if node.get("name") and not node["ignored"]
    ]
    roles = [role for role, _ in found]
    assert [pair for pair in found if pair[0] in operated and not pair[1]] == []
    assert roles.count("image") + roles.count("img") >= 7  # three pictures, four plots
    assert roles.count("slider") >= 2
    assert player.run("return document.documentElement.lang") == "en"


def test_on_a_large_screen_picture_and_text_are_large(player: Browser) -> None:
    size = """const s = document.querySelector('[data-version=ours] .screen');
    return [s.clientHeight / innerHeight, parseFloat(getComputedStyle(document.documentElement).fontSize)]"""
    try:
        player.resize(3840, 2160)
        press(player, "2")
        high, type_size = player.run(size)
        assert high > 0.55
        assert 28 < type_size < 36  # a laptop of 1920 by 1080 has 16 to 18
    finally:
        player.resize(1100)


def test_still_pictures_stand_for_a_long_video(
    browser: Browser, content: PlayerContent, tmp_path: Path
) -> None:
    stills = [np.full((HEIGHT, WIDTH, 3), LEVELS[k]) for k in (0, 20)]
    tiles = Tiles(sheet_of(stills, "PNG"), WIDTH, HEIGHT, 2, np.array([0, 20]))
    write_player_page(tmp_path / "player.html", replace(content, picture=tiles))
    opened(browser, tmp_path / "player.html")
    go_to(browser, 25)  # dimmed by its own factor, though the picture is that of frame 20
    assert np.array_equal(pixels(browser, "full"), stills[1])
    by_definition = 255 * (FACTORS[25] * (stills[1] / 255) ** GAMMA) ** (1 / GAMMA)
    assert np.abs(pixels(browser, "ours") - by_definition).max() <= 2
    press(browser, " ")
    browser.wait_for("return +document.getElementById('frame').textContent > 28")


def test_a_video_that_cannot_be_played_leaves_the_plots(
    browser: Browser, content: PlayerContent, tmp_path: Path
) -> None:
    broken = replace(content.picture, data=b"no video") if isinstance(content.picture, Proxy) else None
    assert broken is not None
    write_player_page(tmp_path / "player.html", replace(content, picture=broken))
    browser.open(tmp_path / "player.html")
    browser.wait_for("return !document.getElementById('trouble').hidden")
    assert text(browser, "#trouble").startswith("No picture: this browser cannot play the video")
    assert not browser.run(SHOWN_CHOICES)
    press(browser, Keys.ARROW_RIGHT)
    assert headings(browser)[0][0] == pytest.approx(FACTORS[1], abs=0.0005)


@contextmanager
def with_script(browser: Browser, source: str) -> Iterator[None]:
    """Pages that are opened run a script first."""
    added = "Page.addScriptToEvaluateOnNewDocument"
    name = browser.driver.execute_cdp_cmd(added, {"source": source})
    try:
        yield
    finally:
        browser.driver.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", name)
        browser.driver.get("about:blank")


def test_it_says_loading_until_a_picture_is_there(browser: Browser, page: Path) -> None:
    with with_script(browser, "HTMLVideoElement.prototype.requestVideoFrameCallback = () => {}"):
        browser.open(page)  # whose frames never come
        browser.wait_for("return document.querySelector('#plots canvas, #plots svg') !== null")
        assert text(browser, "#loading") == "Loading the pictures …"
        assert browser.run(LOADING)
    opened(browser, page)
    assert not browser.run(LOADING)


def test_a_browser_that_does_not_tell_of_frames_goes_by_the_clock(browser: Browser, page: Path) -> None:
    with with_script(browser, "delete HTMLVideoElement.prototype.requestVideoFrameCallback"):
        opened(browser, page)
        go_to(browser, 27)
        browser.wait_for(lambda: np.abs(pixels(browser, "full")[:, 24:] - LEVELS[27]).max() <= 2)
        press(browser, " ")
        browser.wait_for("return +document.getElementById('frame').textContent > 30")


def test_without_webgl_it_says_so_and_the_rest_works(page: Path) -> None:
    with browser_session(webgl=False) as browser:
        browser.open(page)
        browser.wait_for("return !document.getElementById('trouble').hidden")
        said = text(browser, "#trouble")
        assert said == "No picture: this browser does not offer WebGL, which dims it. The plots below work."
        assert not browser.run(SHOWN_CHOICES)
        press(browser, Keys.ARROW_RIGHT, " ")
        browser.wait_for("return +document.getElementById('frame').textContent > 2")


def test_equal_contents_give_equal_pages(content: PlayerContent) -> None:
    assert player_html(content) == player_html(content)


def test_a_picture_of_several_parts_is_in_the_page_as_one(
    content: PlayerContent, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(player_page, "PART", 3)
    found = re.findall(r'data:video/mp4;base64,([^"]*)"', player_html(content))
    assert [base64.b64decode(one, validate=True) for one in found] == [content.picture.data]


def test_a_figure_of_the_price_of_invisibility_that_lies_beside_the_page_is_in_it(
    content: PlayerContent, tmp_path: Path
) -> None:
    (tmp_path / "price.png").write_bytes(b"price")
    write_player_page(tmp_path / "player.html", content)
    shown = "data:image/png;base64,cHJpY2U="  # base64 of these five bytes
    assert shown in (tmp_path / "player.html").read_text(encoding="utf-8")
    assert "price of invisibility" not in player_html(content)


def test_an_option_that_its_words_name_is_shown_without_backticks(content: PlayerContent) -> None:
    unknown = dict.fromkeys(("power_model", "mean_power", "baseline_power", "full_power"))
    for known, words in (
        ({"power_model": "surace2025"}, "as --power-model)"),
        (unknown, "(evenlight run power-"),
    ):
        data = replace(content.data, summary=replace(content.data.summary, **known))
        page = player_html(replace(content, data=data))
        told = page.partition("What the figures above rest on</summary>")[2].partition("</details>")[0]
        assert words in told
        assert "`" not in told


def luminance(colour: str) -> float:
    """Relative luminance of #rrggbb (WCAG 2.2)."""
    parts = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255
    return float(
        np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4) @ [0.2126, 0.7152, 0.0722]
    )


def test_words_stand_out_from_their_ground_in_both_themes(content: PlayerContent) -> None:
    themes = re.findall(r":root[^{]*\{(.*?)\}", player_html(content), re.S)[:2]
    for theme in themes:
        colours = {name: luminance(value) for name, value in re.findall(r"--([\w-]+): (#\w{6})", theme)}
        for ground in ("paper", "raised"):
            for word in ("ink", "muted", "ours", "constant", "limit"):
                dark, light = sorted((colours[ground], colours[word]))
                assert (light + 0.05) / (dark + 0.05) >= 4.5, (ground, word)  # WCAG 2.2, level AA
