"""Four desktops of real windows on a virtual X server: what they show is scripted, and drawn from a seed.

They need Xvfb, xterm, Chromium, mpv and ffmpeg. Text and pictures are those of this repository.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import re
import signal
import socket
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from evenlight.stimuli.sequences import built_in_sequence
from evenlight.stimuli.video_writer import write_video

HERE, ROOT = Path(__file__).parent, Path(__file__).parents[2]
PICTURES = (ROOT / "docs" / "pictures").as_uri()
BROWSER = [
    "--window-size=1920,1080", "--window-position=0,0", "--no-sandbox", "--test-type", "--no-first-run",
    "--hide-crash-restore-bubble", "--disable-gpu", "--disable-background-networking",
]  # fmt: skip
SIZE = "1920x1080x24"
SHOT = 9.0  # [s] of the film: each is a picture of the walk through the house, which the camera nears
NEARER = f"zoompan=z='min(zoom+0.001,1.2)':x='iw/2-iw/zoom/2':y='ih/2-ih/zoom/2':d={24 * SHOT:g}"
Event = tuple[float, Callable[[], None]]  # when [s], and what happens


@dataclass
class VirtualScreen:
    """A virtual X server, the programs on it, and a folder for their files."""

    folder: Path
    environment: dict[str, str]
    programs: list[subprocess.Popen[bytes]] = field(default_factory=list)

    def show(self, *words: str) -> subprocess.Popen[bytes]:
        """Start a program there, as the leader of its processes."""
        nowhere = subprocess.DEVNULL
        program = subprocess.Popen(
            words, env=self.environment, cwd=ROOT, start_new_session=True, stdout=nowhere, stderr=nowhere
        )
        self.programs.append(program)
        return program

    def close(self, program: subprocess.Popen[bytes]) -> None:
        """End a program and its processes."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(program.pid, signal.SIGKILL)
        program.wait()
        self.programs.remove(program)

    def terminal(self, background: str, letters: str) -> subprocess.Popen[bytes]:
        """Show a terminal that fills the screen, in which work is done."""
        look = ["-bg", background, "-fg", letters, "-b", "0", "-fa", "Monospace", "-fs", "11"]
        return self.show("xterm", *look, "-geometry", "213x60+0+0", "-e", "sh", str(HERE / "terminal.sh"))

    def pages(
        self, pages: list[tuple[str, str]], shown: list[tuple[float, int, float]], *options: str
    ) -> None:
        """Show pages, of a look and a text, in a browser: when [s], which, and how far down."""
        page, text = self.folder / "pages.html", (HERE / "pages.html").read_text("utf-8")
        for name, value in (("SHOWN", shown), ("PAGES", pages)):
            text = text.replace(name, json.dumps(value).replace("</", "<\\/"))
        page.write_text(text.replace("PICTURES", PICTURES), encoding="utf-8")
        own = [f"--user-data-dir={self.folder / 'browser'}", page.as_uri()]
        self.show("chromium", *BROWSER, *options, *own)

    def film(self) -> Callable[[float], None]:
        """Show the film on the whole screen; return what seeks in it, to a share of its length."""
        film, control = made_film(self.folder.parent / "film.mp4"), self.folder / "mpv.socket"
        silent = ["--no-config", "--vo=x11", "--ao=null", "--fs", "--loop-file=inf", "--no-osc"]
        self.show("mpv", *silent, f"--input-ipc-server={control}", str(film))

        def seek(share: float) -> None:
            with socket.socket(socket.AF_UNIX) as line, contextlib.suppress(OSError):
                line.connect(str(control))
                asked = {"command": ["seek", 100 * share, "absolute-percent"]}
                line.sendall(json.dumps(asked).encode() + b"\n")

        return seek


@contextmanager
def virtual_screen(folder: Path) -> Iterator[VirtualScreen]:
    """Yield a virtual screen, this process's own, too; at the end all that was started there is ended."""
    folder.mkdir(parents=True, exist_ok=True)
    words = ["Xvfb", "-displayfd", "1", "-screen", "0", SIZE, "-nolisten", "tcp"]
    server = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    assert server.stdout is not None
    os.environ["DISPLAY"] = f":{server.stdout.readline().strip()}"
    os.environ.pop("WAYLAND_DISPLAY", None)
    screen = VirtualScreen(folder, {**os.environ})
    try:
        yield screen
    finally:
        for program in [*screen.programs]:
            screen.close(program)
        server.kill()
        server.communicate()


def made_film(path: Path) -> Path:
    """Return a film of shots along the walk through the house; it is made where it is not there."""
    if not path.exists():
        shots = path.with_suffix(".shots.mkv")
        write_video(shots, built_in_sequence("house", (1280, 720), None, 1 / SHOT).frames(), 1.0)
        way = ["-vf", f"{NEARER}:s=1280x720:fps=24", "-pix_fmt", "yuv420p"]
        subprocess.run(["ffmpeg", "-y", "-v", "error", "-i", str(shots), *way, str(path)], check=True)
    return path


def terminal(screen: VirtualScreen, rng: np.random.Generator, seconds: float) -> list[Event]:
    """Show a dark terminal, in which files are read and programs print."""
    screen.terminal("black", "gray85")
    return []


def browser(screen: VirtualScreen, rng: np.random.Generator, seconds: float) -> list[Event]:
    """Show light and dark pages in a browser's window, scrolled as they are read."""
    files = sorted((ROOT / "docs").glob("*.md"))[:12]
    pages = [(("light", "dark")[k % 2], file.read_text("utf-8")) for k, file in enumerate(files)]
    shown, at = [], 0.0
    while at < seconds:
        page, down = int(rng.integers(len(files))), 0.0
        for _ in range(int(rng.integers(3, 10))):
            shown.append((at, page, down))
            at, down = at + float(rng.uniform(2, 8)), down + float(rng.uniform(0.02, 0.12))
    screen.pages(pages, shown)
    return []


def film(screen: VirtualScreen, rng: np.random.Generator, seconds: float) -> list[Event]:
    """Show a film on the whole screen, with a seek every half minute or so."""
    seek = screen.film()
    times = np.cumsum(rng.uniform(15, 45, int(seconds / 15)))
    return [(float(at), partial(seek, float(rng.uniform()))) for at in times]


def slides(screen: VirtualScreen, rng: np.random.Generator, seconds: float) -> list[Event]:
    """Show slides on the whole screen: text, figures, titles on a dark ground, pictures."""
    figures = [f"![]({name}.png)" for name in ("track", "judge", "rate_limit", "audit-pairings")]
    scenes = [f"![]({name}.png)" for name in ("path-gym", "path-library", "path-basement")]
    text = re.findall(r"^## .*\n\n.*(?:\n- .*)*", (ROOT / "README.md").read_text("utf-8"), re.MULTILINE)
    kinds = {"title": ["# Evenlight"], "slide": [*text[:6], *figures], "full": scenes}
    made = [(kind, words) for kind, own in kinds.items() for words in own]
    times = itertools.accumulate(rng.uniform(10, 40, int(seconds / 10)), initial=0.0)
    screen.pages(made, [(float(at), int(rng.integers(len(made))), 0.0) for at in times], "--kiosk")
    return []


DESKTOPS = {one.__name__: one for one in (terminal, browser, film, slides)}
