"""Films as cameras, broadcasters and editors write them and disks damage them, and what FFmpeg sees in each.

`python tests/companions/odd_films.py FOLDER [NAME ...]` makes those of `odd_films.toml`, and beside each its
truth: NAME.json and NAME.npz. It is made from FFmpeg's raw planes with NumPy, never with our reader.
"""

import json
import random
import re
import struct
import subprocess
import sys
import tomllib
from collections.abc import Callable
from dataclasses import asdict, dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from field_pictures import field_pictures
from numpy.typing import NDArray
from raw_pictures import Layout

WIDTH, HEIGHT, FRAMES = 64, 48, 20
FFMPEG = ("ffmpeg", "-hide_banner", "-nostdin", "-nostats", "-y")
UPRIGHT = (1, 0, 0, 1)
TABLE = Path(__file__).with_suffix(".toml")
PACKET = 188  # bytes of a transport stream
SUBTITLES = b"1\n00:00:00,100 --> 00:00:02,000\nonce upon a time\n"
# What is done to the bytes of a film; numbers are those of its entry.
EDITS: dict[str, Callable[..., bytes]] = {
    "cut_off": lambda content, share: content[: int(share * len(content))],
    "fields": lambda _: field_pictures(),
    "one_bit": lambda content, share: replaced(content, share, lambda old: bytes([old[0] ^ 1]), 1),
    "overwritten": lambda content, share: replaced(
        content, share, lambda _: random.Random(1).randbytes(300), 300
    ),
    "packets_lost": lambda content, first, count: (
        content[: int(first) * PACKET] + content[int(first + count) * PACKET :]
    ),
    "put_before": lambda content, count: bytes(range(int(count))) + content,
    "subtitles": lambda _: SUBTITLES,
    "twice": lambda content: content * 2,
}


@dataclass(frozen=True)
class OddFilm:
    """A film, how it is made, and what a reader must do with it.

    Attributes
    ----------
    name : str
        Of its file.
    command : str
        What FFmpeg is told, but for its output. "<name>" is another film; SOURCE, which stands first where
        nothing else is read, are the frames of `source_pixels`.
    edit : str
        A key of EDITS and its numbers: what is done to the bytes that FFmpeg wrote.
    rate : str
        Of SOURCE [Hz].
    shown : four of -1, 0, 1
        Display matrix that is written into an MP4: a pixel at (x, y) is seen at (ax + cy, bx + dy).
    stream : int
        Which of its video streams is the film.
    refusal : str
        A pattern for the words of its refusal; "" where its frames must be those that FFmpeg sees.
    like : str
        Another film that has its frames, where FFmpeg does not see them in its own.
    whole : str
        The film that it was before it was damaged, where whole pictures of it are left.
    reader : str
        What FFmpeg is told before it reads the film.
    """

    name: str
    command: str = ""
    edit: str = ""
    rate: str = "25"
    shown: tuple[int, int, int, int] = UPRIGHT
    stream: int = 0
    refusal: str = ""
    like: str = ""
    whole: str = ""
    reader: str = ""


@dataclass(frozen=True)
class Truth:
    """What is to be seen in a film.

    Attributes
    ----------
    times : array, (frames,)
        When frames appear, by their stamps [s].
    tick : float
        Of the stream's time stamps [s].
    start : float
        The least stamp of the file, sound included; players count from it [s].
    pixels : array, (frames, height, width, 3)
        Gamma-encoded R, G, B in [0, 1], upright, what is transparent over black; pixels as the file has them.
    aspect : Fraction
        Width of a pixel over its height, upright.
    """

    times: NDArray[np.float64]
    tick: float
    start: float
    pixels: NDArray[np.float64]
    aspect: Fraction


def read_table() -> tuple[dict[str, OddFilm], list[str]]:
    """Return all films by name, and the names of those that `make test` has."""
    table = tomllib.loads(TABLE.read_text(encoding="utf-8"))
    common, words = table.pop("common").split(), table.pop("words")

    def spelt(command: str) -> str:
        while "$" in command:
            command = re.sub(r"\$([A-Z0-9]+)", lambda found: words[found[1]], command)
        return command

    films = {}
    for entries in table.values():
        for pattern, entry in entries.items():
            entry = {"command": entry} if isinstance(entry, str) else entry
            entry["command"] = spelt(entry.get("command", ""))
            each = entry.pop("each", "").split()
            for word in each or [""]:
                put = {"name": pattern, **entry}
                for key in ("name", "command") if word else ():
                    put[key] = put[key].replace("*", word)
                films[put["name"]] = OddFilm(**put)
    return films, common


def source_pixels() -> NDArray[np.uint16]:
    """Return (frames, height, width, 3): smooth colours, fine detail of luma, no two frames alike."""
    k, y, x = np.meshgrid(*map(np.arange, (2 * FRAMES, HEIGHT, WIDTH)), indexing="ij")
    red = np.sin(2 * np.pi * (x / WIDTH + k / 20))
    green = np.sin(2 * np.pi * (y / HEIGHT - k / 13))
    blue = np.cos(2 * np.pi * ((x + y) / 40 + k / 9))
    detail = np.random.default_rng(1).uniform(-0.06, 0.06, (HEIGHT, WIDTH))[y, (x + k) % WIDTH]
    gray = 0.45 + detail + 0.1 * (k % 7) / 6
    return np.rint((0.25 * np.stack([red, green, blue], axis=-1) + gray[..., None]) * 65535).astype("<u2")


def made(film: OddFilm, folder: Path, films: dict[str, OddFilm]) -> Path:
    """Return the path of a film, which is made if it is not there yet, and before it what it is made from."""
    path = folder / film.name
    if path.exists():
        return path
    source = folder / "source.raw"
    if not source.exists():
        source.write_bytes(source_pixels().tobytes())
    for other in re.findall("<(.+?)>", film.command):
        made(films[other], folder, films)
    if film.command:
        command = film.command if "-i " in film.command else f"SOURCE {film.command}"
        if "SOURCE" in command and "-frames:v" not in command:
            command += f" -frames:v {FRAMES}"
        raw = f"-f rawvideo -pix_fmt rgb48le -s {WIDTH}x{HEIGHT} -r {film.rate} -i <{source.name}>"
        words = [
            re.sub("<(.+?)>", lambda found: f"{folder / found[1]}", word)
            for word in command.replace("SOURCE", raw).split()
        ]
        subprocess.run([*FFMPEG, "-v", "error", *words, "-fflags", "+bitexact", path], check=True)
    content = path.read_bytes() if film.command else b""
    if film.shown != UPRIGHT:
        content = shown_by(content, *film.shown)
    if film.edit:
        edit, *numbers = film.edit.split()
        content = EDITS[edit](content, *map(float, numbers))
    path.write_bytes(content)
    return path


def replaced(content: bytes, share: float, new: Callable[[bytes], bytes], size: int) -> bytes:
    """Put other bytes in place of some, from a share of the length on."""
    at = int(share * len(content))
    return content[:at] + new(content[at : at + size]) + content[at + size :]


def shown_by(content: bytes, a: int, b: int, c: int, d: int) -> bytes:
    """Write another display matrix into an MP4 (ISO 14496-12, 6.2.2)."""
    matrix = struct.pack(">9i", a << 16, b << 16, 0, c << 16, d << 16, 0, 0, 0, 1 << 30)
    at = content.index(b"tkhd") + 44
    return content[:at] + matrix + content[at + len(matrix) :]


SEEN = re.compile(r"n: *\d+ pts: *(\S+) .*? fmt:(\S+) .*?sar:(\d+/\d+) s:(\d+)x(\d+) i:(.)")


def truth_of(film: OddFilm, folder: Path, films: dict[str, OddFilm]) -> Truth:
    """Return what is to be seen in a film."""
    if film.like:
        return truth_of(films[film.like], folder, films)
    call = [
        *FFMPEG, "-v", "verbose", "-copyts", "-noautorotate", *film.reader.split(),
        "-i", made(film, folder, films), "-map", f"0:v:{film.stream}", "-fps_mode", "passthrough",
        "-vf", "showinfo", "-f", "rawvideo", "-",
    ]  # fmt: skip
    done = subprocess.run(call, capture_output=True, check=True)
    told = done.stderr.decode(errors="replace")
    tick = float(Fraction(re.search(r"config in time_base: (\d+/\d+)", told)[1]))
    seen, tags = SEEN.findall(told), re.findall(r"color_range:(\S+) color_space:(\S+)", told)
    stream = re.findall("Stream #0:.*Video: (.*)", told)[film.stream]
    left = "left)" in stream or stream.startswith("mpeg2video")  # H.262, 6.1.1.8: also where it is 4:2:2
    _, kind, aspect, width, height, fields = seen[0]
    layout = Layout(kind, int(width), int(height), *reversed(tags[0]), left, woven=fields != "P")
    pixels = np.stack([layout.rgb(f) for f in np.frombuffer(done.stdout, np.uint8).reshape(len(seen), -1)])
    stamps = np.array([int(found[0]) for found in seen])
    later = np.minimum.accumulate(stamps[::-1])[::-1]
    shown = np.append(stamps[:-1] < later[1:], True)  # the others are replaced before they are due
    over = Fraction(aspect) if aspect[-2:] != "/0" and aspect[0] != "0" else Fraction(1)
    upright = over if film.shown[0] else 1 / over
    start = re.search(r"Duration: .*, start: ([-0-9.]+)", told)
    begin, pixels = float(start[1]) if start else 0.0, turned(pixels[shown], *film.shown)
    return Truth(stamps[shown] * tick, tick, begin, pixels, upright)


def left_of(film: OddFilm, folder: Path, films: dict[str, OddFilm]) -> tuple[Truth, NDArray[np.bool_]]:
    """Return what was in a film before its damage, and which pictures FFmpeg still sees as they were."""
    whole, seen = truth_of(films[film.whole], folder, films), truth_of(film, folder, films)
    return whole, np.array([(seen.pixels == picture).all((1, 2, 3)).any() for picture in whole.pixels])


def turned(pixels: NDArray[Any], a: int, b: int, c: int, d: int) -> NDArray[Any]:
    """Return frames whose pixel at (x, y) goes to (ax + cy, bx + dy), the least place of each being 0."""
    return (pixels if a else pixels.swapaxes(1, 2))[:, :: b + d, :: a + c]


def main(folder: Path, names: list[str]) -> None:
    """Make films, and write the truth beside each."""
    folder.mkdir(parents=True, exist_ok=True)
    films, _ = read_table()
    for name in names or films:
        film, path = films[name], made(films[name], folder, films)
        told: dict[str, Any] = {"refusal": film.refusal, "stream": film.stream}
        if not film.refusal:
            told |= asdict(truth_of(film, folder, films))
            np.savez(f"{path}.npz", pixels=np.rint(told.pop("pixels") * 65535).astype(np.uint16))
            told |= {"times": told["times"].tolist(), "aspect": str(told["aspect"])}
        Path(f"{path}.json").write_text(json.dumps(told) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
