"""Unlucky and hostile input of commands: one line, exit code 2, and nothing half-written."""

import csv
import inspect
import io
import logging
import math
import os
import resource
import signal
import struct
import subprocess
import sys
import typing
import warnings
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_files import room
from matplotlib.figure import Figure
from PIL import Image

from evenlight import command as command_line
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import sha256_of_file
from evenlight.data_schema.recordings.dataset_writing import new_dataset
from evenlight.data_schema.storage.append_log import mend_last_line
from evenlight.data_schema.storage.input_sizes import LARGE_OK
from evenlight.data_schema.storage.result_folders import result_folder
from evenlight.data_schema.storage.tables import csv_rows, csv_text, number_in, plain_cell
from evenlight.data_schema.storage.text_files import DEEPEST, read_text
from evenlight.data_schema.storage.whole_files import recording_folder
from evenlight.data_schema.tracks.loss_curves import read_loss_curves
from evenlight.experiments.design_files import DESIGNS, load_design, load_sweep_design
from evenlight.experiments.playback import measured_play
from evenlight.hardware import measure_command
from evenlight.hardware.luminance_table import read_table
from evenlight.hardware.protocols import InstrumentError
from evenlight.method.preset_files import load_display
from evenlight.stimuli.scenes.content.catalogue import path_named
from evenlight.stimuli.scenes.gltf.gltf_file import read_gltf
from evenlight.stimuli.scenes.gltf.gltf_scene import scene_from_gltf
from evenlight.stimuli.sequences import open_video
from evenlight.stimuli.typesetting import require_font
from evenlight.stimuli.video_writer import write_video


@pytest.fixture(autouse=True)
def watchdog() -> Iterator[None]:
    """A hang is a failure after ten seconds."""

    def hang(*_: object) -> None:
        pytest.fail("hangs")

    before = signal.signal(signal.SIGALRM, hang)
    signal.alarm(10)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def refused(command: Callable[..., Any], *arguments: object) -> str:
    """The one line with which a command ends."""
    done = command(*arguments)
    assert (done.code, done.err.count("\n"), done.err[:11]) == (2, 1, "evenlight: ")
    return done.err


def everything(folder: Path) -> list[str]:
    """Names below a folder, hidden ones too."""
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*"))


# Options


def options_of_kind(kind: type) -> list[Any]:
    """Every option of every command that takes a number of a kind: its command, and its name."""
    found = []
    for mounted in (
        *command_line.app.registered_commands,
        *measure_command.measure.registered_commands,
    ):
        assert mounted.callback is not None
        for name, parameter in inspect.signature(mounted.callback, eval_str=True).parameters.items():
            if not typing.get_args(parameter.annotation):  # the context, which is no option
                continue
            of = typing.get_args(parameter.annotation)[0]
            if of is kind or kind in typing.get_args(of):
                found.append(pytest.param(mounted.callback, name, id=f"{mounted.callback.__name__}-{name}"))
    return found


def test_there_are_options_to_try() -> None:
    assert len(options_of_kind(float)) > 25
    assert len(options_of_kind(int)) > 15


def test_a_warm_up_with_more_readings_than_memory(tmp_path) -> None:
    (tmp_path / "d.toml").write_text('name = "x"\nwarm_up_interval_s = 1e-300\n')
    with pytest.raises(InputError, match="warm_up_interval_s must lie in"):
        load_sweep_design("luminance-sweep", str(tmp_path / "d.toml"))


@pytest.mark.parametrize(("callback", "name"), options_of_kind(float))
def test_no_option_takes_what_is_no_number(callback: Callable[..., None], name: str) -> None:
    for value in (math.nan, math.inf, -math.inf):
        with pytest.raises(InputError, match=f"^--{name.replace('_', '-')} must be a finite number, got "):
            callback(**{name: value})


@pytest.mark.parametrize(("callback", "name"), options_of_kind(int))
def test_no_option_takes_whole_numbers_beyond_64_bits(callback: Callable[..., None], name: str) -> None:
    with pytest.raises(InputError, match=r"must be a whole number below 2\^63, got one near 10\^400"):
        callback(**{name: 10**400})


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("render", "sunrise", "--out", ""), "--out is empty"),
        (("render", "sunrise", "--out="), "--out is empty"),
        (("optimize", "sunrise", "--budget", "0.5", "--out", "o", "--display", ""), "--display is empty"),
        (("validate", ""), "an argument is empty"),
        (("measure", "luminance", "--instrument", "simulated", "--interval-s", "inf"), "--interval-s"),
        (("measure", "luminance", "--instrument", "simulated", "--interval-s", "1e300"), "--interval-s"),
        (("measure", "luminance", "--instrument", "simulated", "--count", "1000000000000"), "--count"),
        (("measure", "power", "--instrument", "simulated", "--seconds", "inf"), "--seconds"),
        (("measure", "power", "--instrument", "simulated", "--rate-hz", "1e300"), "--rate-hz"),
        (("plan", "rating", "--out", "p", "--participants", "1_0"), "--participants"),
        (("plan", "rating", "--out", "p", "--participants", "٥"), "--participants"),
        (("render", "sunrise", "--out", "r.mkv", "--duration", "1e300"), "86400 s"),
        (("demo", "--out", "d", "--participants", "1000000000"), "--participants"),
    ],
)
def test_options_with_which_nothing_can_be_done(command, tmp_path, monkeypatch, words, said) -> None:
    monkeypatch.chdir(tmp_path)
    assert said in refused(command, *words)
    assert everything(tmp_path) == []


@pytest.mark.parametrize(
    ("degrees", "size", "said"),
    [
        ("1e-308", (32, 24), "--field-of-view must lie in 0.1 to 175"),
        ("0.1", (32, 32), "shows 7 pixels of the width of v, and at least 8 are needed"),
        ("0.2", (32, 16), "shows 7 pixels of the height of v, and at least 8 are needed"),
    ],
)
def test_a_field_of_view_that_leaves_too_few_pixels(
    command, tmp_path, make_video, degrees, size, said
) -> None:
    """At 72.28 pixels per degree 0.1 of them are 7.2 pixels, 0.2 are 14.5: 14 of 32, and 7 of 16."""
    make_video(tmp_path / "v.mkv", [0.5, 0.6], size, 10.0)
    words = ("optimize", tmp_path / "v.mkv", "--budget", 0.5, "--field-of-view", degrees, "--quiet")
    line = refused(command, *words, "--out", tmp_path / "out")
    assert said in line
    assert everything(tmp_path) == ["v.mkv"]


# What stands in place of a file

READERS: dict[str, Callable[[Path], object]] = {
    "text": lambda path: read_text(path, "text"),
    "display": load_display,
    "design": lambda path: load_design(str(path)),
    "curves": read_loss_curves,
    "digest": sha256_of_file,
    "meter table": read_table,
    "log": mend_last_line,
    "font": require_font,
    "camera path": lambda path: path_named(str(path)),
    "video": lambda path: open_video(str(path)),
    "image": lambda path: list(open_video(str(path.parent)).frames()),
    "gltf": read_gltf,
    "buffer of glTF": lambda path: read_gltf(path.with_name("b.gltf")),
    "array": lambda path: list(open_video(str(path.parent)).frames()),
}
SUFFIXES = {
    "image": ".png",
    "array": ".npy",
    "gltf": ".gltf",
    "buffer of glTF": ".bin",
    "camera path": ".json",
    "video": ".mkv",
}


@pytest.mark.parametrize("reader", READERS)
def test_a_pipe_in_place_of_a_file_is_refused_at_once(tmp_path, reader) -> None:
    """Nobody ever writes into it: opening it to read would wait for ever."""
    path = tmp_path / f"pipe{SUFFIXES.get(reader, '.toml')}"
    (tmp_path / "b.gltf").write_text('{"asset": {"version": "2.0"}, "buffers": [{"uri": "pipe.bin"}]}')
    os.mkfifo(path)
    with pytest.raises(InputError, match=r"is a pipe|is empty"):
        READERS[reader](path)


def test_devices_and_impossible_names_are_refused(tmp_path) -> None:
    with pytest.raises(InputError, match="/dev/zero: is a device; expected text"):
        read_text(Path("/dev/zero"), "text")
    with pytest.raises(InputError, match="is no name of a file"):
        read_text(Path("a\0b"), "text")


def huge_png() -> bytes:
    """9000 x 9000 pixels of a bit, all black, in 10 kB."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", 9000, 9000, 1, 0, 0, 0, 0)
    rows = zlib.compress(bytes(9000 * (1 + 9000 // 8)))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


def huge_curves(path: Path) -> None:
    np.savez_compressed(path, header=np.array("{}"), loss=np.zeros((1 << 21, 9), np.uint8))


def sparse_array(path: Path) -> None:
    np.lib.format.open_memmap(path, "w+", shape=(9000, 9000, 3))


def huge_texture(path: Path) -> None:
    scene = room()
    scene.add_texture(0, huge_png())
    path.write_bytes(scene.content())


def huge_meshes(path: Path) -> None:  # a thousand that share their points
    scene = room()
    scene.header["accessors"][0]["count"] = 30_000
    scene.header["meshes"] *= 1000
    path.write_bytes(scene.content())


PROMISES: dict[str, tuple[Callable[[Path], object], Callable[[Path], object], str]] = {
    "a.json": (lambda path: os.truncate(path, 1 << 40), lambda path: read_text(path, "text"), "bytes"),
    "a.npz": (huge_curves, read_loss_curves, "numbers"),
    "a.npy": (sparse_array, READERS["array"], "numbers"),
    "a.png": (lambda path: path.write_bytes(huge_png()), READERS["image"], "pixels"),
    "a.gif": (lambda path: Image.new("1", (9000, 9000)).save(path), READERS["video"], "pixels"),
    "a.glb": (huge_texture, lambda path: scene_from_gltf(read_gltf(path)), "pixels in a texture"),
    "b.glb": (huge_meshes, lambda path: scene_from_gltf(read_gltf(path)), "points and corners"),
    "c.glb": (lambda path: os.truncate(path, 1 << 40), read_gltf, "bytes"),
}


@pytest.mark.parametrize("name", PROMISES)
def test_what_promises_gigabytes_is_refused_before_memory_is_taken(tmp_path, name) -> None:
    make, read, counted = PROMISES[name]
    path = tmp_path / name
    path.touch()
    make(path)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(InputError, match=rf"{name}.*{counted}.*`large_ok`") as refused:
        read(path)
    assert "\n" not in str(refused.value)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100 * 1024  # [KiB]


def test_large_files_are_read_where_that_is_asked_for(tmp_path, monkeypatch, command) -> None:
    monkeypatch.setenv(LARGE_OK, "")
    (tmp_path / "images").mkdir()
    (tmp_path / "images/a.png").write_bytes(huge_png())
    huge_texture(tmp_path / "a.glb")
    words = ("optimize", tmp_path / "images", "--budget", 0.5, "--out", tmp_path / "out")
    assert "more than 67108864 pixels (--large-ok)" in refused(command, *words, "--quiet")
    command("validate", tmp_path, "--large-ok")
    assert next(open_video(str(tmp_path / "images")).frames()).shape == (9000, 9000)
    assert scene_from_gltf(read_gltf(tmp_path / "a.glb"))


def test_what_a_terminal_would_obey_is_printed_as_escapes(tmp_path, command) -> None:
    (tmp_path / "a\x1b]0;title\x07\u202egpj.display.toml").write_text("")
    said = command("validate", tmp_path)
    assert r"a\x1b]0;title\x07\u202egpj.display.toml: is empty" in said.out
    line = refused(command, "validate", tmp_path / "b\x1b[2J\nevenlight: ok")
    assert r"b\x1b[2J evenlight: ok" in line


def test_a_refusal_is_one_line_whatever_its_values_hold() -> None:
    for kind in (InputError, InstrumentError):
        assert str(kind("no 'a\nb\x1b[2J\u2028c'")) == r"no 'a b\x1b[2J c'"


def test_spreadsheets_compute_no_words_of_a_table(tmp_path) -> None:
    words = ["\t=1", "=A('b')", "+cmd|calc", "@SUM(1)", "-x", "'=1", "''+1", "'a", "a=b", "-5", "+1e3"]
    (tmp_path / "a.csv").write_text(csv_text(["name"], [[word] for word in words]))
    with (tmp_path / "a.csv").open() as stream:
        _, *cells = csv.reader(stream)
    assert [cell for (cell,) in cells if cell[0] in "=+@-\t"] == ["-5", "+1e3"]
    assert [cell for _, (cell,) in csv_rows(tmp_path / "a.csv", ["name"], "a table")] == words


def test_lines_of_matplotlib_do_not_come_through(command) -> None:
    command("--version")
    assert not logging.getLogger("matplotlib.font_manager").isEnabledFor(logging.WARNING)
    with warnings.catch_warnings(record=True) as told:
        Figure(figsize=(1, 1)).text(0.5, 0.5, "\u6620").figure.savefig(io.BytesIO())
    assert not told


# What stands in a file


def design_with(folder: Path, line: str) -> Path:
    """The quick design with another line in place of the one of its key."""
    key = line.partition(" ")[0]
    lines = (DESIGNS / "quick.design.toml").read_text().splitlines()
    path = folder / "d.toml"
    path.write_text("\n".join([line, *(old for old in lines if not old.startswith(f"{key} "))]))
    return path


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("trials_per_level = 1" + "0" * 400, r"below 2\^63, got one near 10\^400"),
        ("trials_per_level = 1000000000", "trials_per_level must be at most 10000, got 1000000000"),
        ("pause_duration_s = 1e300", r"pause_duration_s must lie in 0\.001 to 86400 s, got 1e\+300"),
        ("pause_duration_s = 1e-300", r"pause_duration_s must lie in 0\.001 to 86400 s, got 1e-300"),
    ],
)
def test_a_design_of_which_a_session_would_not_end(tmp_path, line, said) -> None:
    with pytest.raises(InputError, match=said):
        load_design(str(design_with(tmp_path, line)))


@pytest.mark.parametrize("content", ["", " \n\n"])
def test_an_empty_design_is_no_design(command, tmp_path, content) -> None:
    (tmp_path / "empty.toml").write_text(content)
    words = ("simulate", "ramp", "--participants", 1, "--design", tmp_path / "empty.toml")
    assert "empty.toml: is empty; expected a ramp design" in refused(command, *words, "--out", tmp_path / "o")
    assert everything(tmp_path) == ["empty.toml"]


@pytest.mark.parametrize("depth", [DEEPEST + 1, 900, 100_000])
def test_deep_json_is_refused_wherever_it_is_read(command, tmp_path, depth) -> None:
    """900 levels are few enough for a parser, and too many for what walks through them afterwards."""
    path = tmp_path / "deep.json"
    path.write_text("[" * depth + "]" * depth)
    for words in (("validate", path), ("render", path, "--out", tmp_path / "v.mkv")):
        assert "nested too deep" in refused(command, *words)
    words = ("import", path, "--task", "rating", "--out", tmp_path / "lab")
    assert "nested too deep" in refused(command, *words)
    assert everything(tmp_path) == ["deep.json"]


@pytest.mark.parametrize(
    "text", ["1_000", "١٢", "1٢", "0x10", "nan", "inf", "1e", ".", "", "1,5", "--1", "1 2"]
)
def test_what_is_a_number_to_python_alone(text) -> None:
    with pytest.raises(InputError, match=r"t\.csv: expected a number, got"):
        number_in(text, "t.csv")
    assert [plain_cell(kind, text) for kind in (int, float)] == [text, text]  # which a record refuses


def test_numbers_of_spreadsheets_stay_numbers() -> None:
    assert [number_in(text, "") for text in (" 1 ", "+2", "1e3", "-.5", "3.")] == [1, 2, 1000, -0.5, 3]
    assert plain_cell(int, " 12") == 12
    assert plain_cell(int, "1e3") == "1e3"


def test_a_file_of_one_endless_line(command, tmp_path) -> None:
    (tmp_path / "t.csv").write_text("x" * 20_000_000)
    refused(command, "import", tmp_path / "t.csv", "--task", "rating", "--out", tmp_path / "lab")
    assert everything(tmp_path) == ["t.csv"]


# Where results go


def test_render_replaces_a_file_only_by_force(command, tmp_path) -> None:
    out = tmp_path / "v.mkv"
    out.write_text("mine")
    words = ("render", "checkerboard", "--size", "16x16", "--duration", 0.2, "--out", out, "--quiet")
    assert "is there already; give --force to replace it, or another name" in refused(command, *words)
    assert out.read_text() == "mine"
    assert command(*words, "--force").code == 0
    assert out.read_bytes()[:4] == bytes.fromhex("1a45dfa3")  # EBML, of Matroska
    out.unlink()
    os.mkfifo(out)
    assert "give the name of a file" in refused(command, *words, "--force")
    assert out.is_fifo()


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    """What makes a folder a data set."""
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab" / "dataset_description.json").write_text("{}")
    return tmp_path / "lab"


@pytest.mark.parametrize("words", [("fit",), ("analyze",)])
@pytest.mark.parametrize("inside", ["", "results", "sub-01/ses-01"])
def test_results_stay_out_of_the_data_set(command, dataset, words, inside) -> None:
    before = everything(dataset)
    assert "lies in the data set" in refused(command, *words, dataset, "--out", dataset / inside)
    assert everything(dataset) == before


def test_what_a_killed_run_left_goes_and_nothing_else(tmp_path) -> None:
    for left in ("out", ".partial.out", ".earlier.out"):  # killed when it had replaced the earlier result
        (tmp_path / left).mkdir()
        (tmp_path / left / ".DS_Store").write_text("")
    for name in (".partial.mine", "partial.out", "out.partial"):
        (tmp_path / name).mkdir()
    with result_folder(tmp_path / "out", "optimize") as folder:
        (folder / "a.csv").write_text("1")
    there = {path.name for path in tmp_path.iterdir()}
    assert there == {".partial.mine", "partial.out", "out.partial", "out"}


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_killed_run_is_cleared_by_the_next(tmp_path) -> None:
    """Really killed, with its folder held until then."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        with result_folder(tmp_path / "out", "optimize") as folder:
            (folder / "half.csv").write_text("half")
            os.write(writing, b"x")
            signal.pause()
        os._exit(0)
    os.read(reading, 1)
    with pytest.raises(InputError, match="another program is writing it"):  # it lives
        fill(tmp_path / "out")
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    assert (tmp_path / ".partial.out" / "half.csv").exists()
    fill(tmp_path / "out")
    assert everything(tmp_path) == ["out", "out/x"]
    os.close(reading)
    os.close(writing)


def fill(out: Path) -> None:
    with new_dataset(out) as folder:
        (folder / "x").write_text("")


def test_a_full_disk_in_the_middle_of_a_video(tmp_path) -> None:
    """Files may have 20 000 bytes: what FFmpeg cannot write is told by its name, and nothing of it stays."""
    noise = np.random.default_rng(1).integers(0, 255, (10, 64, 64, 3), dtype=np.uint8)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
    try:
        with pytest.raises(InputError, match=r"cannot write .*v\.mkv: "):
            write_video(tmp_path / "new" / "v.mkv", list(noise), 10)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert everything(tmp_path) == []


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_under_the_output() -> None:
    program = "from evenlight.command import main; main(['--version'])"
    with Path("/dev/full").open("w") as full:
        ended = subprocess.run(
            [sys.executable, "-c", program], stdout=full, stderr=subprocess.PIPE, check=False
        )
    assert ended.returncode == 2
    assert ended.stderr.count(b"\n") == 1
    assert b"No space left on device" in ended.stderr


# Recording


@pytest.mark.parametrize("place", [".dataset.lock", "sub-01/ses-01/.session.lock"])
def test_a_lock_that_cannot_be_taken_is_no_traceback(command, tmp_path, place) -> None:
    """As in a data set of someone else: not even an administrator writes a file onto a folder."""
    (tmp_path / "lab" / place).mkdir(parents=True)
    (tmp_path / "lab" / "dataset_description.json").write_text('{"Simulated": true}')
    (tmp_path / "lab" / "participants.tsv").write_text("participant_id\tsimulated\nsub-01\ttrue\n")
    words = ("run", "ramp", "--participant", "01", "--session", "01", "--rig", "simulated")
    before = everything(tmp_path)
    line = refused(command, *words, "--simulate", "data", "--design", "quick", "--out", tmp_path / "lab")
    assert "cannot write to the folder" in line
    left = set(everything(tmp_path)) - set(before)
    of_data_set = {".dataset.lock", ".bidsignore", "README", "participants.json"}  # what it lacked
    assert left <= {f"lab/{name}" for name in of_data_set}


def test_measured_power_that_is_refused_leaves_nothing(command, tmp_path, make_stimulus, make_video) -> None:
    make_stimulus(tmp_path / "track", np.linspace(0.9, 0.5, 4), frames_per_second=10.0)
    make_video(tmp_path / "v.mkv", np.linspace(0.2, 0.9, 4), (32, 24), 10.0)
    rig = (Path(measure_command.__file__).parent / "rigs" / "simulated.rig.toml").read_text()
    lines = [line for line in rig.splitlines() if not line.startswith(("power_meter", "backlight"))]
    (tmp_path / "r.toml").write_text(
        'power_meter = "simulated"\nbacklight = "simulated"\n' + "\n".join(lines)
    )
    before = everything(tmp_path)

    def no_screen(*_: object, **__: object) -> None:
        raise InstrumentError("there is no screen")

    words = (
        "measure",
        "played",
        tmp_path / "v.mkv",
        tmp_path / "track",
        "--rig",
        tmp_path / "r.toml",
        "--simulate",
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(measured_play, "open_devices", no_screen)
        done = command(*words, "--out", tmp_path / "new" / "power")
    assert (done.code, "there is no screen" in done.err) == (1, True)
    assert everything(tmp_path) == before


def test_what_was_recorded_before_a_failure_stays(tmp_path) -> None:
    def record() -> None:
        with recording_folder(tmp_path / "power", "power_log.json"):
            (tmp_path / "power" / "power_log.json").write_text("{}")
            raise InstrumentError("unplugged")

    with pytest.raises(InstrumentError):
        record()
    assert everything(tmp_path) == ["power", "power/power_log.json"]
