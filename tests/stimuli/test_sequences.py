"""Built-in sequences show what the paper's figures describe; `evenlight render` writes them."""

import numpy as np
import pytest
from typer.testing import CliRunner

from evenlight.command import app
from evenlight.data_schema.errors import InputError
from evenlight.stimuli.checkerboard import white_tiles
from evenlight.stimuli.sequence_format import on_grid
from evenlight.stimuli.sequences import SEQUENCES, WALKS, built_in_sequence, open_video

SMALL = (96, 54)

# Those that are painted; walks through scenes are tested in test_scene_sequences.py.
PAINTED = [name for name in SEQUENCES if name not in WALKS]


def luminances(frames):
    """Return the mean luminance of each frame on a display of gamma 2.2, as a share of its peak."""
    rec709 = [0.2126, 0.7152, 0.0722]
    return np.array([((f.pixel_values / 65535) ** 2.2 @ rec709).mean() for f in frames])


@pytest.fixture(scope="module")
def sunrise():
    return list(built_in_sequence("sunrise", size=SMALL, duration=2.04).frames())


@pytest.mark.parametrize("name", PAINTED)
def test_sequences_are_the_same_at_every_run(name):
    first, again = (built_in_sequence(name, size=SMALL, duration=0.2) for _ in range(2))
    for a, b in zip(first.frames(), again.frames(), strict=True):
        np.testing.assert_array_equal(a.pixel_values, b.pixel_values)
    assert first.sha256() == again.sha256()


@pytest.mark.parametrize("name", PAINTED)
@pytest.mark.parametrize("change", [{"size": (64, 36)}, {"duration": 1.0}, {"frames_per_second": 50.0}])
def test_the_hash_tells_formats_apart(name, change):
    assert built_in_sequence(name).sha256() != built_in_sequence(name, **change).sha256()


@pytest.mark.parametrize("name", PAINTED)
@pytest.mark.parametrize("size", [(8, 8), (33, 17), (17, 64)])
def test_sequences_have_the_size_rate_and_length_that_were_asked_for(name, size):
    sequence = built_in_sequence(name, size=size, duration=0.5, frames_per_second=12)
    frames = list(sequence.frames())
    assert sequence.n_frames == len(frames) == 6
    assert {f.pixel_values.shape for f in frames} == {(size[1], size[0], 3)}
    np.testing.assert_allclose([f.time for f in frames], np.arange(6) / 12)


@pytest.mark.parametrize("name", PAINTED)
def test_pixel_values_lie_on_the_10_bit_grid(name):
    for frame in built_in_sequence(name, size=SMALL, duration=0.2).frames():
        assert frame.pixel_values.dtype == np.uint16
        steps = frame.pixel_values * (1023 / 65535)
        # A 16-bit code next to a 10-bit level is at most half a code from it: 0.5 * 1023 / 65535 levels.
        assert np.abs(steps - np.rint(steps)).max() <= 0.5 * 1023 / 65535 + 1e-9


def test_the_checkerboard_starts_black_and_white_and_ends_black():
    frames = list(built_in_sequence("checkerboard").frames())
    assert len(frames) == 500
    assert set(np.unique(frames[0].pixel_values)) == {0, 65535}
    assert (frames[0].pixel_values > 0).mean() == pytest.approx(0.5, abs=0.01)
    assert (frames[-1].pixel_values == 0).all()


def test_the_white_tiles_fade_evenly_and_the_black_ones_stay():
    sequence = built_in_sequence("checkerboard", size=SMALL, duration=4.04)
    white = white_tiles(*SMALL)
    for k, frame in enumerate(sequence.frames()):
        assert (frame.pixel_values[~white] == 0).all()
        expected = 65535 * (1 - k / 100)
        # Rounded to a level of 10 bits, half of which is 32 codes, and then to a code.
        np.testing.assert_allclose(frame.pixel_values[white], expected, atol=33)


def test_tiles_meet_only_at_their_corners():
    white = white_tiles(640, 360)
    board = white[:, :240]  # tiles of 60 pixels
    assert (board[:-60] != board[60:]).all()
    assert (board[:, :-60] != board[:, 60:]).all()


def test_the_sunrise_runs_backwards_from_its_middle(sunrise):
    assert len(sunrise) == 51
    for k in range(25):
        np.testing.assert_array_equal(sunrise[k].pixel_values, sunrise[50 - k].pixel_values)


def test_the_sun_brings_more_than_one_log_unit_of_light(sunrise):
    light = luminances(sunrise)
    assert light[25] / light[0] > 10
    # From night to the free sun, at half of the way, every frame is brighter than the one before.
    assert (np.diff(light[:14]) > 0).all()


def test_the_night_still_shows_detail():
    night = next(built_in_sequence("sunrise").frames()).pixel_values / 65535
    gray = night.mean(axis=2)
    # Neighbouring blocks of 8x8 pixels differ by a level of an 8-bit display or more, nearly everywhere.
    blocks = gray.reshape(45, 8, 80, 8)
    assert np.median(blocks.max(axis=(1, 3)) - blocks.min(axis=(1, 3))) > 1 / 255
    assert gray.mean() < 0.2


def test_names_serve_as_videos_and_a_path_wins_over_a_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert open_video("checkerboard").n_frames == 500
    (tmp_path / "checkerboard").mkdir()
    np.save(tmp_path / "checkerboard" / "a.npy", np.zeros((8, 8, 3)))
    assert open_video("checkerboard").n_frames == 1


@pytest.mark.parametrize(
    "change",
    [
        {"size": (4, 4)}, {"size": (640, 99999)}, {"duration": 0.0}, {"duration": -1.0},
        {"duration": float("nan")}, {"duration": 0.04}, {"frames_per_second": 0.0},
        {"frames_per_second": float("inf")},
    ],
)  # fmt: skip
def test_impossible_formats_are_refused(change):
    with pytest.raises(InputError, match="cannot render sunrise: need"):
        built_in_sequence("sunrise", **change)


def test_an_unknown_sequence_lists_the_known_ones():
    with pytest.raises(
        InputError, match=r"no built-in sequence 'sunset': there are checkerboard, sunrise, library"
    ):
        built_in_sequence("sunset")


# --- render command


def render(*arguments):
    """Run the command; errors of input come out as exceptions, which `main` turns into a line."""
    return CliRunner().invoke(app, ["render", *map(str, arguments)], catch_exceptions=False)


# One path of one scene: the others, and the other scene, are walked in tests/stimuli/test_scene_walks.py.
@pytest.mark.parametrize(("name", "seconds"), [("checkerboard", 0.4), ("sunrise", 0.4), ("house", 0.1)])
def test_the_file_holds_the_sequence_without_loss(tmp_path, name, seconds):
    path = tmp_path / "out.mkv"
    words = ("--size", "48x27", "--duration", seconds, "--fps", "29.97", "--quiet")
    result = render(name, "--out", path, *words)
    assert (result.exit_code, result.output) == (0, "")
    sequence = built_in_sequence(name, (48, 27), seconds, 29.97)
    for read, made in zip(open_video(str(path)).frames(), sequence.frames(), strict=True):
        np.testing.assert_array_equal(read.pixel_values, made.pixel_values)
        assert read.time == pytest.approx(made.time, abs=1e-12)
        assert read.duration == pytest.approx(made.duration, abs=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("sunset",), "there are checkerboard, sunrise"),
        (("sunrise", "--size", "big"), "--size big: give width and height"),
        (("sunrise", "--size", "4x4"), "from 8x8"),
        (("sunrise", "--duration", "0"), "need two frames or more"),
        (("sunrise", "--fps", "-1"), "need a frame rate"),
    ],
)
def test_what_cannot_be_rendered_is_refused_before_any_work(tmp_path, arguments, message):
    with pytest.raises(InputError, match=message):
        render(*arguments, "--out", tmp_path / "out.mkv", "--quiet")
    assert list(tmp_path.iterdir()) == []


def test_a_larger_sunrise_shows_the_same_scene():
    small, large = (
        next(iter(built_in_sequence("sunrise", size=size, duration=0.08).frames())).pixel_values.mean(axis=2)
        for size in ((160, 90), (320, 180))
    )
    halved = large.reshape(90, 2, 160, 2).mean(axis=(1, 3))
    assert np.corrcoef(small.ravel(), halved.ravel())[0, 1] > 0.9


def test_the_ends_of_the_range_are_the_ends_of_the_grid():
    assert on_grid([0.0, 1.0]).tolist() == [0, 65535]
