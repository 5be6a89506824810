"""The link to a real runtime: what it says of its headset, its frames, codes and the operator's window.

Monado's simulated headset has 320 x 240 pixels for each eye, eyes 63 mm apart, and moves by itself.
"""

import ctypes
import math
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import glfw
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import ImageGrab

from evenlight.data_schema.recordings.rig import Eye
from evenlight.hardware.presentation.headset_views import HeadsetFrame
from evenlight.hardware.presentation.openxr_headset import OpenXRHeadset
from evenlight.hardware.presentation.openxr_runtime import EGL, OpenXRRuntime
from evenlight.hardware.protocols import InstrumentError

WIDTH, HEIGHT = 320, 240
SOON = 10.0  # [s]
LOSE = """
import os, sys
from evenlight.hardware.presentation.openxr_headset import OpenXRHeadset
from evenlight.hardware.protocols import InstrumentError
with OpenXRHeadset() as link:
    print("open", flush=True)
    sys.stdin.readline()
    try:
        while True:
            link.begin_frame()
            link.framebuffer().clear()
            link.end_frame()
    except InstrumentError as error:
        print(error.fault.value, "start it again" in str(error), flush=True)
print("closed")
"""

PHOTOGRAPH = """
import os, sys, time
import glfw, numpy as np
from PIL import ImageGrab
from evenlight.hardware.presentation.openxr_headset import OpenXRHeadset
with OpenXRHeadset() as link:
    glfw.hide_window(link.mirror._window)
    for code in map(int, sys.argv[1:]):
        started = time.monotonic()
        lit = set()
        while lit != {code} and time.monotonic() - started < 10:  # it is a few frames behind
            for _ in range(5):
                link.begin_frame()
                link.framebuffer().clear(code / 255, code / 255, code / 255, 1.0)
                link.end_frame()
            picture = np.asarray(ImageGrab.grab(xdisplay=os.environ["DISPLAY"]))
            lit = set(picture[picture > 0].tolist())  # in front of the black root
        print(*lit)
"""


@pytest.fixture(params=["EGL", "GLX"])
def link(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[OpenXRHeadset]:
    if request.param == "GLX":
        offers = OpenXRRuntime.offers
        monkeypatch.setattr(OpenXRRuntime, "offers", lambda self, name: name != EGL and offers(self, name))
    with OpenXRHeadset() as opened:
        yield opened


def shown(link: OpenXRHeadset, codes: NDArray[np.uint8] | None = None) -> HeadsetFrame:
    """A frame of these codes, (height, width, 4), row 0 on top."""
    frame = link.begin_frame()
    framebuffer = link.framebuffer()
    framebuffer.clear()
    if codes is not None:
        height, width = codes.shape[:2]
        picture = link.context().texture((width, height), 4, codes[::-1].tobytes())
        source = link.context().framebuffer([picture])
        link.context().copy_framebuffer(framebuffer, source)
        link.mirror.take(framebuffer, (WIDTH, 0, WIDTH, HEIGHT))
    link.end_frame()
    link.mirror.show()
    return frame


def test_it_says_what_the_runtime_says(link: OpenXRHeadset) -> None:
    facts = link.facts()
    assert "Monado" in facts.runtime
    assert "Simulated" in facts.system
    assert link.view_sizes() == 2 * (facts.eye_size,) == 2 * ((WIDTH, HEIGHT),)
    assert facts.eye_distance == pytest.approx(0.063, abs=1e-4)
    for fov in facts.fovs:
        edges = [math.degrees(edge) for edge in (fov.left, fov.right, fov.down, fov.up)]
        assert edges == pytest.approx([-42.5, 42.5, -44.6, 44.6], abs=0.1)
    for eye in Eye:  # Monado hides four corners, an eighth of the width and an eighth of the height
        seen = link.seen_pixels(eye)
        assert not seen[[0, 0, -1, -1], [0, -1, 0, -1]].any()
        assert seen[HEIGHT // 2].all()
        assert 1 - seen.mean() == pytest.approx(4 / 2 / 8**2, abs=1e-3)
    said = link.apparatus()
    assert "none" in said["controller_left"]
    assert all(said[package][0].isdigit() for package in ("pyopenxr", "glfw", "moderngl"))


def test_frames_follow_each_other_at_the_period_and_the_session_is_in_front(link: OpenXRHeadset) -> None:
    frames = [shown(link) for _ in range(20)][5:]  # the first ones come before the runtime has its pace
    steps = [after.display_time - before.display_time for before, after in pairwise(frames)]
    periods = np.array(steps) / frames[0].period
    assert np.median(periods) == pytest.approx(1.0, abs=0.01)
    np.testing.assert_allclose(periods, periods.round(), atol=0.05)  # a slow machine skips whole ones
    assert abs(frames[-1].display_time - link.now()) < 1.0
    assert all(frame.visible and frame.tracked for frame in frames)
    assert link.focused()


def test_the_head_carries_its_eyes(link: OpenXRHeadset) -> None:
    for frame in [shown(link) for _ in range(5)]:
        positions = np.array([eye.pose.position for eye in frame.eyes])
        np.testing.assert_allclose(positions.mean(axis=0), frame.head.position, atol=1e-4)
        assert math.hypot(*frame.head.orientation) == pytest.approx(1.0, abs=1e-4)


def test_codes_stay_as_they_are_written(link: OpenXRHeadset) -> None:
    codes = np.zeros((HEIGHT, 2 * WIDTH, 4), np.uint8)
    codes[:, :256] = np.arange(256)[None, :, None]
    codes[:, WIDTH : WIDTH + 256] = np.arange(256)[None, ::-1, None]
    for _ in range(3):  # every picture of the swapchain
        link.begin_frame()
        framebuffer = link.framebuffer()
        source = link.context().framebuffer([link.context().texture((2 * WIDTH, HEIGHT), 4, codes.tobytes())])
        link.context().copy_framebuffer(framebuffer, source)
        read = np.frombuffer(framebuffer.read(components=4), np.uint8).reshape(codes.shape)
        link.end_frame()
        np.testing.assert_array_equal(read, codes)


def test_the_mirror_shows_one_eye_over_its_text(link: OpenXRHeadset) -> None:
    codes = np.full((HEIGHT, 2 * WIDTH, 4), 50, np.uint8)
    codes[: HEIGHT // 2, WIDTH:] = 120
    codes[HEIGHT // 2 :, WIDTH:] = 200
    coverage = np.zeros((96, 960), np.uint8)
    coverage[:, :480] = 255
    link.mirror.say(coverage)
    started = time.monotonic()
    while True:
        shown(link, codes)
        picture = np.asarray(ImageGrab.grab(xdisplay=os.environ["DISPLAY"]))[..., 1]
        if picture[180, 480] == 120 or time.monotonic() - started > SOON:
            break
    # 960 x 720 for the picture of 320 x 240, and the strip of 96 under it.
    seen = [int(picture[row, column]) for row, column in ((180, 480), (540, 480), (760, 200), (760, 700))]
    text, ground = round(0.9 * 255), round(0.1 * 255)
    np.testing.assert_allclose(seen, [120, 200, text, ground], atol=1)


def test_keys_over_the_mirror_are_heard_by_their_names(link: OpenXRHeadset) -> None:
    x = ctypes.CDLL("libX11.so.6")
    x.XOpenDisplay.restype = ctypes.c_void_p
    server = ctypes.c_void_p(x.XOpenDisplay(None))
    window = glfw.get_x11_window(link.mirror._window)
    places = {"f3": 69, "escape": 9, "y": 29, "3": 12, "num_7": 79, "left": 113, "comma": 59}
    for at, code in enumerate(places.values()):
        for kind in (2, 3):  # KeyPress, KeyRelease of X
            event = (ctypes.c_long * 24)(kind, 0, 1, server.value, window, 0, 0, 1000 + 100 * at + 10 * kind)
            ctypes.memmove(ctypes.addressof(event) + 84, (ctypes.c_uint32 * 2)(code, 1), 8)
            x.XSendEvent(server, ctypes.c_ulong(window), 1, ctypes.c_long(3), event)
    x.XSync(server, 0)
    before, heard = link.now(), []
    while len(heard) < len(places) and link.now() - before < SOON:
        shown(link)
        heard += link.mirror.pressed()
    assert [press.name for press in heard] == list(places)
    assert all(before - 1 <= press.time <= link.now() for press in heard)
    assert link.mirror.held() == frozenset()


def test_a_closed_link_refuses_and_closes_again() -> None:
    link = OpenXRHeadset()
    link.close()
    link.close()
    with pytest.raises(InstrumentError, match="closed"):
        link.begin_frame()


def test_a_size_of_the_rigs_own_is_drawn() -> None:
    with OpenXRHeadset((200, 100)) as link:
        shown(link)
        link.begin_frame()
        assert link.framebuffer().size == (400, 100)
        assert link.facts().eye_size == (WIDTH, HEIGHT)
        link.end_frame()


def test_too_large_a_picture_is_refused() -> None:
    with pytest.raises(InstrumentError, match="smaller window_size"):
        OpenXRHeadset((100_000, 100))


@contextmanager
def own_runtime(folder: Path, **variables: str) -> Iterator[tuple[subprocess.Popen[bytes], dict[str, str]]]:
    """A runtime besides that of the tree, which may be ended; and the environment of its clients."""
    folder.mkdir(0o700)
    own = os.environ | {"XDG_RUNTIME_DIR": str(folder)}
    with subprocess.Popen(
        ["monado-service"], env=own | variables, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as service:  # fmt: skip
        try:
            while not (folder / "monado_comp_ipc").exists():
                assert service.poll() is None
                time.sleep(0.1)
            yield service, own
        finally:
            service.kill()


def test_a_runtime_that_goes_away_is_told_and_closing_does_not_wait(tmp_path: Path) -> None:
    with (
        own_runtime(tmp_path / "runtime") as (service, own),
        subprocess.Popen(
            [sys.executable, "-c", LOSE], env=own, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as client,
    ):
        assert client.stdin is not None
        assert client.stdout is not None
        assert client.stdout.readline() == "open\n"
        client.stdin.write("\n")
        client.stdin.flush()
        time.sleep(0.5)
        service.kill()
        started = time.monotonic()
        said = client.stdout.read()
    assert said.splitlines() == ["disconnected True", "closed"]
    assert time.monotonic() - started < SOON


def test_codes_arrive_in_the_headsets_display_as_they_are_drawn(tmp_path: Path) -> None:
    """In a window of the compositor: codes of a picture that is no sRGB would be encoded once more."""
    codes = (50, 102, 200)
    with own_runtime(tmp_path / "runtime", XRT_COMPOSITOR_FORCE_XCB="1", XRT_COMPOSITOR_NULL="0") as (_, own):
        shown = subprocess.run(
            [sys.executable, "-c", PHOTOGRAPH, *map(str, codes)],
            env=own,
            capture_output=True,
            text=True,
            check=False,
        )
    # 102 would arrive as 169 or 170: 255 (1.055 (102 / 255)^(1 / 2.4) - 0.055)
    assert [list(map(int, line.split())) for line in shown.stdout.splitlines()] == [[code] for code in codes]
