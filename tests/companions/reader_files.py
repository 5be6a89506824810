"""What readers of the pages have before the first command: films, tables, a rig, recorded sessions.

All of it is small, and belongs to a monitor of the reader's, which is none of the presets.
"""

import datetime
import json
import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import av
import numpy as np
from av.video.frame import VideoFrame
from gltf_files import room
from matplotlib import get_data_path
from page_commands import ROOT, page_file

VERSIONS = {"ours": "TBM", "baseline": "constant"}
PEOPLE, SEQUENCES = ("a1", "b2", "c3", "d4", "e5", "f6"), ("library", "gym")

SLIDER = """\
[columns]
rating = "slider.response"
response_time = "slider.rt"
trial_index = "trials.thisN"
sequence = "scene"
version = "condition"
[units]
response_time = "s"
[values.version]
ours = "TBM"
baseline = "const"
"""

# The inputs that a page says its reader has.
HAS: dict[str, tuple[str, ...]] = {
    "README.md": ("film.mp4", "films", "answers.csv", "lab"),
    "docs/first-hour.md": ("demo", "answers.csv"),
    "docs/drivers.md": ("meter.py",),
    "docs/extending.md": ("desk.rig.toml",),
    "docs/guides/engineer.md": ("film.mp4",),
    "docs/guides/experimenter.md": ("film.mp4", "lab"),
    "docs/guides/researcher.md": ("answers.csv", "journal.mplstyle"),
    "docs/headset.md": ("film.mp4", "headset.rig.toml"),
    "docs/importing.md": (
        "ratings.csv", "lab.csv", "07_detail.csv", "data.json", "likert.toml", "data", "slider.toml",
    ),
    "docs/measuring.md": ("film.mp4", "film-dimmed.mp4", "desk.rig.toml", "calibration"),
    "docs/requests.md": ("film.mp4",),
    "docs/scale.md": ("films",),
    "docs/scenes.md": ("lab.glb", "walk.json"),
    "docs/sessions.md": ("film.mp4", "lab", "pages-ja", "NotoSansJP-Regular.ttf"),
    "docs/statistics.md": ("lab",),
    "docs/tracks.md": ("film.mp4", "lab.display.toml", "desk.rig.toml"),
    "docs/triggers.md": ("desk.rig.toml",),
    "docs/using-a-track.md": ("film.mp4", "film-track", "sweep"),
    "docs/validity.md": ("film.mp4",),
    "docs/viewing-experiments.md": ("desk.rig.toml", "calibration", "stimuli"),
}  # fmt: skip


def named(words: list[str]) -> tuple[str, ...]:
    """Return the files that a command line takes for granted: those that it names, but for what it writes."""
    before = ["", *words]
    return tuple(
        word
        for k, word in enumerate(words)
        if before[k] not in ("--out", "rig") and hasattr(Shelf, _method(word))
    )


class Shelf:
    """Makes each file once, and copies it into the folders of the pages.

    Parameters
    ----------
    folder : Path
        Where they are kept.
    evenlight : callable
        Runs the command with some words in the current folder.
    """

    def __init__(self, folder: Path, evenlight: Callable[..., Any]) -> None:
        self.folder, self._evenlight = folder, evenlight

    def put(self, page: str, names: tuple[str, ...], folder: Path) -> None:
        """Put files, of these names, into the folder of a page."""
        for name in names:
            if shown := page_file(page, name):
                (folder / name).write_text(shown)
                continue
            self.make(name)
            for made in self.folder.glob("desk.*.toml" if name == "desk.rig.toml" else name):
                if made.is_dir():
                    shutil.copytree(made, folder / made.name, dirs_exist_ok=True)
                else:
                    shutil.copy(made, folder / made.name)

    def make(self, name: str) -> None:
        """Make a file, or a folder, if it is not there."""
        if not (self.folder / name).exists():
            getattr(self, _method(name))()

    def _write(self, name: str, text: str) -> None:
        (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
        (self.folder / name).write_text(text)

    def _run(self, *words: str) -> None:
        outcome = self._evenlight(*words)
        assert outcome.code == 0, f"{words}: {outcome.err}"

    def _make_film_mp4(self) -> None:
        """Two seconds at 12 Hz: noise, that is bright, then dark, then bright."""
        rng = np.random.default_rng(24)
        with av.open(str(self.folder / "film.mp4"), "w") as file:
            stream = file.add_stream("libx264", rate=12)
            stream.width, stream.height, stream.pix_fmt = 96, 54, "yuv420p"
            for k in range(24):
                noise = rng.normal(120 + 70 * np.cos(k / 4), 25, (54, 96, 3))
                frame = VideoFrame.from_ndarray(np.clip(noise, 0, 255).astype(np.uint8), format="rgb24")
                file.mux(stream.encode(frame))
            file.mux(stream.encode(None))

    def _make_films(self) -> None:
        """A folder of two films."""
        self.make("film.mp4")
        (self.folder / "films").mkdir()
        for name in ("harbour.mp4", "night-train.mp4"):
            shutil.copy(self.folder / "film.mp4", self.folder / "films" / name)

    def _make_desk_display_toml(self) -> None:
        self.make("desk.rig.toml")

    def _make_lab_display_toml(self) -> None:
        self.make("desk.rig.toml")
        self._write("lab.display.toml", (self.folder / "desk.display.toml").read_text())

    def _make_desk_rig_toml(self) -> None:
        """A desktop monitor that was measured today, and simulated instruments."""
        self._run("new", "rig", "desk.rig.toml", "--display", "desktop-lcd")
        today = datetime.datetime.now(datetime.UTC).date()
        display = self.folder / "desk.display.toml"
        display.write_text(f'{display.read_text()}\nmeasured = "{today}"\n')
        rig = self.folder / "desk.rig.toml"
        for meter in ("luminance_meter", "power_meter"):
            assert f'{meter} = "none"' in rig.read_text()
            rig.write_text(rig.read_text().replace(f'{meter} = "none"', f'{meter} = "simulated"'))

    def _make_lab(self) -> None:
        self.make("desk.rig.toml")
        people = ("--participants", "5", "--design", "recommended")
        self._run("simulate", "ramp", *people, "--display", "desk.display.toml", "--out", "lab")
        shutil.rmtree(self.folder / "lab/sub-01")  # who comes next is the first
        listed = self.folder / "lab/participants.tsv"
        listed.write_text(re.sub(r"^sub-01.*\n", "", listed.read_text(), flags=re.MULTILINE))

    def _make_calibration(self) -> None:
        self.make("lab")
        self._run("fit", "lab", "--out", "calibration")

    def _make_film_track(self) -> None:
        self.make("film.mp4")
        self.make("desk.rig.toml")
        words = ("--display", "desk.display.toml", "--other-display-ok", "--no-player")
        self._run("optimize", "film.mp4", "--budget", "0.5", *words, "--out", "film-track")

    def _make_film_dimmed_mp4(self) -> None:
        self.make("film-track")
        self._run("apply", "film.mp4", "film-track", "--out", "film-dimmed.mp4")

    def _make_demo(self) -> None:
        self.make("film-track")
        shutil.copytree(self.folder / "film-track", self.folder / "demo/track")

    def _make_sweep(self) -> None:
        curve = "factor,luminance_cd_m2\n0.2,50\n0.6,149\n1,248\n"
        self._write("sweep/brightness.csv", curve)

    def _make_answers_csv(self) -> None:
        self._write("answers.csv", _ratings("participant,sequence,version,rating"))

    def _make_journal_mplstyle(self) -> None:
        self._write("journal.mplstyle", "font.family: serif\n")

    def _make_scores_csv(self) -> None:
        self._write("scores.csv", _ratings("participant,sequence,version,score"))

    def _make_study(self) -> None:
        self.make("answers.csv")
        self._run("import", "answers.csv", "--task", "rating", "--out", "study")

    def _make_ratings_csv(self) -> None:
        self._write("ratings.csv", _ratings("participant,sequence,version,rating"))

    def _make_lab_csv(self) -> None:
        self._write("lab.csv", _ratings("VP,sequence,version,score,rt", VERSIONS))

    def _make_07_detail_csv(self) -> None:
        self._write("07_detail.csv", _psychopy(PEOPLE))

    def _make_data(self) -> None:
        for person in PEOPLE:
            self._write(f"data/{person}.csv", _psychopy((person,)))

    def _make_slider_toml(self) -> None:
        self._write("slider.toml", SLIDER)

    def _make_data_json(self) -> None:
        rows = []
        for line in _ratings("p,s,v,r,t").splitlines()[1:]:
            person, sequence, version, rating, time = line.split(",")
            answer = {"task": "rating", "participant": person, "scene": sequence, "version": version}
            rows += [answer | {"response": {"Q0": int(rating) - 1}, "rt": int(time)}, {"task": "pause"}]
        self._write("data.json", json.dumps(rows))

    def _make_pages_ja(self) -> None:
        shutil.copytree(ROOT / "experiments/pages/en", self.folder / "pages-ja")

    def _make_NotoSansJP_Regular_ttf(self) -> None:
        font = Path(get_data_path()) / "fonts/ttf/DejaVuSans.ttf"
        shutil.copy(font, self.folder / "NotoSansJP-Regular.ttf")

    def _make_lab_glb(self) -> None:
        scene = room()
        scene.header["nodes"][0]["scale"] = [1.6, 1.0, 3.1]  # about the walk of the page, 1.5 m by 5 m
        (self.folder / "lab.glb").write_bytes(scene.content())

    def _make_stimuli(self) -> None:
        """The track and video of another sequence, made as the page makes those of the library."""
        self.make("calibration")
        (self.folder / "stimuli/basement").mkdir(parents=True)
        video, made = "stimuli/basement/video.mkv", ("--display", "desk.display.toml")
        self._run("render", "basement", *made, "--size", "64x36", "--fps", "1", "--out", video)
        limit = ("--rate-limit", "calibration/rate_limit.json", "--actuator", "pixels", "--no-player")
        self._run("optimize", video, "--budget", "0.3", *made, *limit, "--out", "stimuli/basement")


def _method(name: str) -> str:
    """Return the method of a shelf that makes a file."""
    return "_make_" + re.sub(r"\W", "_", name)


def _ratings(header: str, versions: dict[str, str] | None = None) -> str:
    """Return a table of ratings: one better with ours, for every other person."""
    rows, columns = [header], header.count(",") + 1
    for k, person in enumerate(PEOPLE):
        for j, sequence in enumerate(SEQUENCES):
            for version in VERSIONS:
                rating = 3 + (version == "ours") * (k % 2) - j
                named = (versions or {}).get(version, version)
                cells = [person, sequence, named, rating, 900 + 7 * k + 31 * j]
                rows.append(",".join(map(str, cells[:columns])))
    return "\n".join(rows) + "\n"


def _psychopy(people: tuple[str, ...]) -> str:
    """Return a wide table as PsychoPy writes it, with the rows of a routine between."""
    rows, count = ["participant,trials.thisN,scene,condition,slider.response,slider.rt"], {}
    for line in _ratings("p,s,v,r,t", VERSIONS | {"baseline": "const"}).splitlines()[1:]:
        person, sequence, version, rating, time = line.split(",")
        if person in people:
            count[person] = count.get(person, -1) + 1
            rows.append(f"{person},{count[person]},{sequence},{version},{rating},{int(time) / 1000}")
            rows.append(f"{person},,,,,")
    return "\n".join(rows) + "\n"


def install(package: Path, site: Path) -> None:
    """Do what pip does with an example: its modules on the path, and what it says of its entry points."""
    import tomllib

    project = tomllib.loads((package / "pyproject.toml").read_text())["project"]
    name = project["name"].replace("-", "_")
    folder = site / f"{name}-{project['version']}.dist-info"
    folder.mkdir(parents=True)
    (folder / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    )
    groups = [
        f"[{group}]\n" + "".join(f"{key} = {value}\n" for key, value in names.items())
        for group, names in project["entry-points"].items()
    ]
    (folder / "entry_points.txt").write_text("\n".join(groups))
    shutil.copytree(package / name, site / name)
    sys.path.insert(0, str(site))
