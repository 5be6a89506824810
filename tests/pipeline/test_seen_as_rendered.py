"""A sequence is analysed as large as it was rendered to be seen: by commands and functions, and as a file."""

import json
from dataclasses import replace

import numpy as np
import pytest
from optimized_videos import frames_of, texture

import evenlight
from evenlight.data_schema.display import pixels_per_degree_at
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.tracks.brightness_track import read_track
from evenlight.data_schema.tracks.loss_curves import read_loss_curves
from evenlight.experiments.playback.screen_geometry import ScreenGeometry
from evenlight.stimuli.sequences import built_in_sequence, open_video
from evenlight.stimuli.video.viewing_geometry import viewing_geometry
from evenlight.stimuli.video_writer import write_video

pytestmark = pytest.mark.usefixtures("blank_pictures")
PANEL = evenlight.load_display("varjo-xr3")
# 96 pixels over 90 degrees: the picture plane is 48 pixels away, and a degree is 48 · π / 180 pixels there.
DENSITY = 48 * np.pi / 180
FORMAT = ("--size", "96x54", "--duration", 1, "--fps", 5, "--quiet")


@pytest.fixture(scope="module")
def sequence():
    return built_in_sequence("checkerboard", (96, 54), 1.0, 5.0)


@pytest.fixture
def rendered(command, tmp_path):
    """The same sequence as a file."""
    path = tmp_path / "board.mkv"
    assert command("render", "checkerboard", "--out", path, *FORMAT).code == 0
    return path


def test_a_sequence_is_analysed_at_its_field_of_view_unless_another_is_given(sequence) -> None:
    own, asked = evenlight.loss_curves(sequence), evenlight.loss_curves(sequence, field_of_view=90)
    assert (own.field_of_view, own.display.pixels_per_degree) == (90, pytest.approx(DENSITY))
    np.testing.assert_array_equal(own.loss, asked.loss)
    narrow = evenlight.loss_curves(sequence, field_of_view=1.4)
    assert narrow.display.pixels_per_degree == pytest.approx(96 / 1.4, rel=1e-3)
    assert np.abs(narrow.loss - own.loss).max() > 0.01


def test_frames_of_which_nothing_is_known_are_taken_pixel_for_pixel(sequence) -> None:
    made = evenlight.optimize(list(sequence.frames()), 0.5)
    assert made.track.header.field_of_view is None
    assert made.track.header.pixels_per_degree == PANEL.pixels_per_degree


def test_a_film_fills_a_flat_display_of_known_size_unless_another_angle_is_asked(sequence) -> None:
    """1200 mm at 2.4 m; 4:3 leaves bars, and 900 mm. No more pixels are left than the display has."""
    tv = replace(PANEL, resolution=(1920, 1080), size=(1200.0, 675.0), viewing_distance=2.4)
    tv = replace(tv, pixels_per_degree=pixels_per_degree_at(tv.resolution, tv.size, 2.4))
    seen = [viewing_geometry(s, tv, None, "a") for s in ((1920, 1080), (3840, 2160), (1440, 1080), (96, 54))]
    assert [one.shown_size for one in seen] == [(1920, 1080), (1920, 1080), (1440, 1080), (96, 54)]
    wide = [2 * np.degrees(np.arctan(width / 4.8)) for width in (1.2, 1.2, 0.9, 1.2)]
    assert [one.field_of_view for one in seen] == pytest.approx(wide)
    frames = list(sequence.frames())
    curves = [evenlight.loss_curves(frames, display=tv, field_of_view=asked) for asked in (None, wide[0], 0)]
    assert [one.field_of_view for one in curves] == [pytest.approx(wide[0])] * 2 + [None]
    np.testing.assert_array_equal(curves[0].loss, curves[1].loss)
    assert evenlight.loss_curves(sequence, display=tv).field_of_view == 90  # its own


def test_the_file_of_a_sequence_gives_its_track(sequence, rendered) -> None:
    of_file, of_sequence = evenlight.optimize(rendered, 0.5), evenlight.optimize(sequence, 0.5)
    np.testing.assert_array_equal(of_file.factors, of_sequence.factors)
    for made in (of_file, of_sequence):
        assert made.track.header.field_of_view == made.outcome.field_of_view == 90
        assert made.track.header.pixels_per_degree == pytest.approx(DENSITY)


def test_what_is_rendered_for_a_display_fills_it(command, tmp_path) -> None:
    """Or is pixel for pixel on it, where its size is not known: 48 pixels from the middle to the edge."""
    path, half = tmp_path / "board.mkv", np.arctan(np.radians(48 / PANEL.pixels_per_degree))
    laptop = evenlight.load_display("laptop-lcd")
    wide = np.arctan(laptop.size[0] / 2000 / laptop.viewing_distance)  # as 16:9 as the panel
    for display, angle in ((PANEL, half), (laptop, wide)):
        asked = ("render", "checkerboard", "--display", display.name, "--out", path, "--force", *FORMAT)
        assert command(*asked).code == 0
        assert evenlight.loss_curves(path, display=display).field_of_view == pytest.approx(
            np.degrees(2 * angle), rel=1e-3
        )


def test_what_is_rendered_at_the_resolution_of_a_display_has_its_pixels() -> None:
    """So that nothing is scaled where it is shown; any other size is, and is told which would not be."""
    tv = replace(PANEL, resolution=(96, 54), size=(960.0, 540.0), viewing_distance=2.4)
    tv = replace(tv, pixels_per_degree=pixels_per_degree_at(tv.resolution, tv.size, 2.4))
    sharp, soft = (built_in_sequence("checkerboard", size, 1.0, 5.0, tv) for size in ((96, 54), (48, 27)))
    assert sharp.field_of_view == pytest.approx(2 * np.degrees(np.arctan(0.48 / 2.4)))
    assert soft.field_of_view == sharp.field_of_view
    shown = [
        ScreenGeometry((one.format.width, one.format.height), one.field_of_view, tv, None)
        for one in (sharp, soft)
    ]
    assert [one.scale for one in shown] == [1.0, pytest.approx(2.0, rel=1e-3)]
    assert "with --display and --size 96x54 makes" in shown[1].in_words("board", (64, 36))
    tall = built_in_sequence("checkerboard", (54, 54), 1.0, 5.0, tv)  # bars at its sides
    assert tall.field_of_view == pytest.approx(2 * np.degrees(np.arctan(0.27 / 2.4)))


@pytest.mark.parametrize(("degrees", "read"), [(72.5, 72.5), (1 / 3 + 60, 1 / 3 + 60), (None, None)])
def test_a_file_keeps_its_field_of_view(tmp_path, degrees, read) -> None:
    write_video(tmp_path / "v.mkv", frames_of([texture(1)] * 2), 5.0, field_of_view=degrees)
    assert open_video(str(tmp_path / "v.mkv")).field_of_view == read


@pytest.mark.parametrize("tag", [b"wide", b"-9.5", b"1e99", b" nan"])
def test_a_damaged_field_of_view_is_named(command, tmp_path, tag) -> None:
    path = tmp_path / "v.mkv"
    write_video(path, frames_of([texture(1)] * 2), 5.0, field_of_view=72.5)
    whole = path.read_bytes()
    assert whole.count(b"72.5") == 1
    path.write_bytes(whole.replace(b"72.5", tag))
    with pytest.raises(InputError, match=r"v\.mkv: its tag FIELD_OF_VIEW is .* expected 0\.1 to 175 degrees"):
        open_video(str(path))


def test_the_command_says_how_large_the_video_is_seen_and_writes_it_down(command, rendered, tmp_path) -> None:
    told = command("optimize", "--no-player", rendered, "--budget", 0.5, "--out", tmp_path / "seen")
    assert "board: analysed at 90°, 0.838 pixels/°" in told.err
    asked = ("--budget", 0.5, "--field-of-view", 1.4, "--no-player")
    narrow = command("optimize", rendered, *asked, "--out", tmp_path / "narrow")
    assert "board: analysed at 1.4°, 68.6 pixels/°" in narrow.err
    summary = json.loads((tmp_path / "narrow" / "summary.json").read_text())
    assert summary["field_of_view_deg"] == 1.4
    assert read_track(tmp_path / "narrow" / "track.csv").header.field_of_view == 1.4
    refused = command(
        "optimize", rendered, "--budget", 0.5, "--curves", tmp_path / "narrow" / "loss_curves.npz",
        "--out", tmp_path / "again", "--quiet", "--no-player",
    )  # fmt: skip
    assert refused.code == 2
    assert "made for 'varjo-xr3' at 1.4°, 68.6 pixels/°, asked is 'varjo-xr3' at 90°" in refused.err


def test_the_controller_sees_what_the_optimizer_sees(command, rendered, tmp_path) -> None:
    asked = ("control", rendered, "--target-loss", 0.05, "--no-player", "--quiet")
    assert command(*asked, "--out", tmp_path / "pid").code == 0
    curves = read_loss_curves(tmp_path / "pid" / "loss_curves.npz")
    assert curves.field_of_view == read_track(tmp_path / "pid" / "track.csv").header.field_of_view == 90
    assert curves.display.pixels_per_degree == pytest.approx(DENSITY)


@pytest.mark.parametrize("degrees", [90.0, 0.5])
def test_a_render_loop_names_the_field_of_view_of_its_frames(sequence, degrees) -> None:
    """At 90 degrees the display has more pixels than the frame; at 0.5 it has 36 of its 96."""
    frames = [frame.pixel_values for frame in sequence.frames()]
    curves = evenlight.loss_curves(frames, fps=5.0, field_of_view=degrees)
    knot = len(curves.factors) // 2
    online = evenlight.OnlineController(0.05, field_of_view=degrees, start_factor=curves.factors[knot])
    for _ in range(2):  # the first frame's loss is read from its curve, the second's measured at the factor
        online.step(frames[0])
        assert online.loss == pytest.approx(curves.loss[0, knot], abs=1e-6)


def test_a_render_loops_frames_keep_their_size() -> None:
    online = evenlight.OnlineController(0.05, field_of_view=0.5)
    online.step(np.zeros((54, 96, 3), dtype=np.uint8))
    with pytest.raises(InputError, match="expected a frame of the shape"):
        online.step(np.zeros((60, 96, 3), dtype=np.uint8))


def test_a_track_of_an_earlier_version_has_no_field_of_view(sequence, tmp_path) -> None:
    made = evenlight.optimize(sequence, 0.5)
    made.save(tmp_path)
    sidecar = tmp_path / "track.json"
    header = json.loads(sidecar.read_text())
    assert header.pop("field_of_view_deg") == 90
    sidecar.write_text(json.dumps(header))
    read = read_track(tmp_path / "track.csv").header
    assert replace(read, files={}) == replace(made.track.header, field_of_view=None)


def test_a_picture_has_one_size(command, tmp_path) -> None:
    both = ("--display", "varjo-xr3", "--field-of-view", 60)
    told = command("render", "checkerboard", *both, "--out", tmp_path / "v.mkv")
    assert (told.code, told.err.count("\n")) == (2, 1)
    assert "--field-of-view and --display" in told.err
    too_wide = command("render", "checkerboard", "--field-of-view", 180, "--out", tmp_path / "v.mkv")
    assert "need a field of view from 0.1 to 175 degrees, got 180" in too_wide.err
    assert list(tmp_path.iterdir()) == []
