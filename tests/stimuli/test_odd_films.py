"""Films of other people: what is damaged, joined or cut; all other kinds are in `benchmarks/studies`."""

from pathlib import Path

import numpy as np
import pytest
from odd_films import N, copied, encoded, pictures, times

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.sequences import open_video


def joined(folder: Path, overlap: int) -> tuple[Path, Path]:
    parts = encoded(folder / "parts.mkv", "ffv1", g="1"), folder / "joined.mkv"
    copied(*parts, overlap=overlap)
    return parts


def test_of_cuts_that_overlap_the_later_is_seen_and_it_is_said(tmp_path):
    parts, film = joined(tmp_path, 2)
    np.testing.assert_allclose(times(film), np.arange(N - 2) / 25, atol=1e-9)
    np.testing.assert_array_equal(pictures(film), np.delete(pictures(parts), (8, 9), axis=0))
    assert "2 pictures are left out: time stamps fall back by up to 0.040 s" in open_video(film).notes[0]


def test_stamps_that_begin_anew_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"time stamps fall back by up to 0\.360 s, and 10 of 20 pictures"):
        open_video(joined(tmp_path, 10)[1])


def test_what_is_damaged_is_refused_held_or_skipped(tmp_path):
    whole = encoded(tmp_path / "whole.mkv", "ffv1", level="3", slicecrc="1", g="1")
    content = bytearray(whole.read_bytes())
    content[len(content) // 2] ^= 1
    (film := tmp_path / "film.mkv").write_bytes(content)
    with pytest.raises(InputError, match=r"frame \d+ \(0\.\d+ s\): its checksum .*`damaged` hold or skip"):
        open_video(film)
    before, held = pictures(whole), pictures(film, damaged="hold")
    (k,) = np.flatnonzero((before != held).any(axis=(1, 2, 3)))
    np.testing.assert_array_equal(held[k], before[k - 1])
    np.testing.assert_array_equal(pictures(film, damaged="skip"), np.delete(before, k, axis=0))
    np.testing.assert_allclose(times(film, damaged="skip"), np.delete(np.arange(N) / 25, k), atol=1e-3)
    hold, skip = (open_video(film, damaged=how).reading for how in ("hold", "skip"))
    assert (hold.frames_held, hold.frames_skipped, skip.frames_held, skip.frames_skipped) == (1, 0, 0, 1)
