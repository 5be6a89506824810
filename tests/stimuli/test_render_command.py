"""`evenlight render` writes a built-in sequence as a file that reads back as the sequence itself."""

import numpy as np
import pytest
from typer.testing import CliRunner

from evenlight.command import app
from evenlight.data_schema.errors import InputError
from evenlight.stimuli.sequences import built_in_sequence, open_video

pytestmark = pytest.mark.slow


def render(*arguments):
    """Run the command; errors of input come out as exceptions, which `main` turns into a line."""
    return CliRunner().invoke(app, ["render", *map(str, arguments)], catch_exceptions=False)


# One path of each scene: the others are walked in tests/stimuli/test_scene_walks.py.
@pytest.mark.parametrize(
    ("name", "seconds"), [("checkerboard", 0.4), ("sunrise", 0.4), ("gym", 0.1), ("house", 0.1)]
)
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
