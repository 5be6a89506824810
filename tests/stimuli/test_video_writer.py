"""Lossless video: what is written comes back bit by bit, or no file is there at all."""

import numpy as np
import pytest

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.sequences import open_video
from evenlight.stimuli.video.video_writer import write_video


def noise(kind, size=(33, 17), frames=4):
    """Return frames that use every bit of their type."""
    top = np.iinfo(kind).max
    rng = np.random.default_rng(5)
    return [rng.integers(0, top, (size[1], size[0], 3), endpoint=True).astype(kind) for _ in range(frames)]


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_frames_come_back_bit_by_bit(tmp_path, kind):
    written = noise(kind)
    assert write_video(tmp_path / "a.mkv", iter(written), 25) == 4
    for frame, pixels in zip(open_video(str(tmp_path / "a.mkv")).frames(), written, strict=True):
        assert frame.pixel_values.dtype == kind
        np.testing.assert_array_equal(frame.pixel_values, pixels)


@pytest.mark.parametrize("bits", [10, 12])
def test_values_on_the_grid_of_fewer_bits_come_back_bit_by_bit(tmp_path, bits):
    top = 2**bits - 1
    # A value on the grid is the 16-bit code next to k/top of the full range.
    codes = np.rint(np.arange(top + 1) * (65535 / top)).astype(np.uint16)
    picture = np.resize(codes, (64, 64, 3))
    write_video(tmp_path / "a.mkv", [picture], 25, bits=bits)
    (frame,) = open_video(str(tmp_path / "a.mkv")).frames()
    np.testing.assert_array_equal(frame.pixel_values, picture)


@pytest.mark.parametrize("rate", [25, 23.976, 29.97, 12.5, 60])
def test_the_times_come_back_exactly(tmp_path, rate):
    write_video(tmp_path / "a.mkv", noise(np.uint8, frames=30), rate)
    exact = {23.976: 24000 / 1001, 29.97: 30000 / 1001}.get(rate, rate)
    times = [frame.time for frame in open_video(str(tmp_path / "a.mkv")).frames()]
    np.testing.assert_allclose(times, np.arange(30) / exact, rtol=0, atol=1e-12)


def test_the_same_frames_make_the_same_file(tmp_path):
    for name in ("a.mkv", "b.mkv"):
        write_video(tmp_path / name, noise(np.uint16), 25)
    assert (tmp_path / "a.mkv").read_bytes() == (tmp_path / "b.mkv").read_bytes()


def test_a_failure_on_the_way_leaves_nothing_and_keeps_what_was_there(tmp_path):
    (tmp_path / "a.mkv").write_bytes(b"before")

    def breaking():
        yield from noise(np.uint8)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_video(tmp_path / "a.mkv", breaking(), 25)
    assert [p.name for p in tmp_path.iterdir()] == ["a.mkv"]
    assert (tmp_path / "a.mkv").read_bytes() == b"before"


def test_no_frames_make_no_file(tmp_path):
    with pytest.raises(InputError, match="no frames"):
        write_video(tmp_path / "a.mkv", [], 25)
    assert list(tmp_path.iterdir()) == []


def test_frames_of_another_size_are_a_mistake(tmp_path):
    with pytest.raises(ValueError, match="need frames of shape"):
        write_video(tmp_path / "a.mkv", [*noise(np.uint8), *noise(np.uint8, size=(8, 8))], 25)
    assert list(tmp_path.iterdir()) == []


def test_16_bit_frames_are_not_cut_to_8(tmp_path):
    with pytest.raises(ValueError, match="need uint8 for 8 bits"):
        write_video(tmp_path / "a.mkv", noise(np.uint16), 25, bits=8)


def test_other_suffixes_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"ends in \.mkv"):
        write_video(tmp_path / "a.mp4", noise(np.uint8), 25)


def test_a_place_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot write"):
        write_video(tmp_path / "file" / "a.mkv", noise(np.uint8), 25)
