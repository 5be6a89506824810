"""`evenlight apply` from end to end: what it says, and what it refuses in one line with nothing written."""

import dataclasses

import numpy as np
import pytest
from tracked_videos import DISPLAY, decoded_planes, film, smooth_planes, track_of

from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.storage.text_files import write_toml_record
from evenlight.data_schema.tracks.brightness_track import read_track, write_track


@pytest.fixture
def work(tmp_path):
    """A folder with a video of four frames and its track."""
    film(tmp_path / "film.mkv", smooth_planes(4))
    track_of(tmp_path / "film.mkv", tmp_path / "track")
    return tmp_path


def refused(command, work, *more, out="out.mp4", video="film.mkv"):
    """Run the command, which must end with code 2 and one line, and leave no file; return the line."""
    before = {p: p.stat().st_mtime_ns for p in work.rglob("*")}
    words = ("apply", work / video, work / "track", "--out", work / out, *more)
    result = command(*words)
    assert result.code == 2, result
    assert result.err.count("\n") == 1
    assert "Traceback" not in result.err
    assert {p: p.stat().st_mtime_ns for p in work.rglob("*") if p.is_file()} == {
        p: t for p, t in before.items() if p.is_file()
    }
    return result.err


def test_a_video_is_dimmed_by_its_track(command, work):
    result = command("apply", work / "film.mkv", work / "track", "--out", work / "out.mp4")
    assert (result.code, result.err) == (0, "")
    assert "4 frames, dimmed by its track, factors 0.4 to 0.7" in result.out
    levels = [planes[0].mean() for planes in decoded_planes(work / "out.mp4")]
    scales = [
        (level - 16) / (planes[0].mean() - 16) for level, planes in zip(levels, smooth_planes(4), strict=True)
    ]
    wanted = np.array([0.4, 0.5, 0.6, 0.7]) ** (1 / DISPLAY.gamma)
    np.testing.assert_allclose(scales, wanted, atol=0.002)


def test_the_constant_version_has_one_factor(command, work):
    words = ("apply", work / "film.mkv", work / "track", "--out", work / "out.mkv", "--quiet")
    result = command(*words, "--version", "constant")
    assert (result.code, result.out, result.err) == (0, "", "")
    for planes, before in zip(decoded_planes(work / "out.mkv"), smooth_planes(4), strict=True):
        scale = (planes[0].mean() / 4 - 16) / (before[0].mean() - 16)
        assert scale == pytest.approx(0.55 ** (1 / DISPLAY.gamma), abs=1e-3)


def test_a_folder_of_images_takes_its_rate_from_the_track(command, work):
    (work / "images").mkdir()
    for k in range(3):
        np.save(work / "images" / f"{k}.npy", np.full((32, 32, 3), 100, np.uint8))
    track_of(work / "images", work / "track")
    result = command("apply", work / "images", work / "track", "--out", work / "out.mp4", "--quiet")
    assert result.code == 0, result.err


def test_an_existing_file_is_replaced_only_with_force(command, work):
    (work / "out.mp4").write_bytes(b"before")
    assert "is there already; give --force" in refused(command, work)
    words = ("apply", work / "film.mkv", work / "track", "--out", work / "out.mp4", "--quiet")
    assert command(*words, "--force").code == 0
    assert (work / "out.mp4").stat().st_size > 100


def test_the_video_itself_is_never_written_over(command, work):
    assert "is the video itself" in refused(command, work, "--force", out="film.mkv")


@pytest.mark.parametrize(
    ("out", "more", "words"),
    [
        ("out.avi", (), "need a name that ends in .mp4, .mov, .mkv, got .avi"),
        ("out.mp4", ("--codec", "ffv1"), ".mp4 files cannot hold ffv1; give a name that ends in .mkv"),
        ("out.mov", ("--codec", "av1"), ".mov files cannot hold av1"),
        ("track", (), "need a name that ends in"),
        ("film.mkv/out.mkv", (), "cannot write"),
    ],
)
def test_files_that_cannot_be_written_are_refused(command, work, out, more, words):
    assert words in refused(command, work, *more, out=out)


def test_a_track_of_another_video_is_refused(command, work):
    film(work / "other.mkv", smooth_planes(5)[1:])
    assert "the track was made of the video 'film'" in refused(command, work, video="other.mkv")
    words = ("apply", work / "other.mkv", work / "track", "--out", work / "out.mkv", "--quiet")
    assert command(*words, "--other-video-ok").code == 0


def test_a_video_of_another_length_or_other_times_is_refused_whatever_is_said(command, work):
    film(work / "long.mkv", smooth_planes(5))
    film(work / "slow.mkv", smooth_planes(4), stamps=[0, 40, 90, 120])
    assert "has 5 frames, and its brightness track 4" in refused(
        command, work, "--other-video-ok", video="long.mkv"
    )
    assert "frame 2" in refused(command, work, "--other-video-ok", video="slow.mkv")


def test_another_display_is_refused(command, work):
    other = dataclasses.replace(DISPLAY, name="other", gamma=2.4)
    write_toml_record(work / "other.toml", other)
    assert "the track was made for the display 'varjo-xr3'" in refused(
        command, work, "--display", work / "other.toml"
    )


def test_an_earlier_track_needs_its_display(command, work):
    track = read_track(work / "track" / "track.csv")
    other = dataclasses.replace(DISPLAY, name="other", gamma=2.4)
    header = dataclasses.replace(
        track.header, display=None, display_name="other", display_fingerprint=other.fingerprint,
        provenance=provenance_now(inputs=dict(track.header.provenance.inputs)),
    )  # fmt: skip
    write_track(work / "track" / "track.csv", dataclasses.replace(track, header=header))
    assert "give the display as --display, a file" in refused(command, work)
    write_toml_record(work / "other.toml", other)
    words = ("apply", work / "film.mkv", work / "track", "--out", work / "out.mkv", "--quiet")
    assert command(*words, "--display", work / "other.toml").code == 0


def test_hdr_and_damage_are_refused_in_a_line(command, work):
    film(work / "hdr.mkv", smooth_planes(4), tags=(1, 9, 9, 18))
    assert "HDR (HLG)" in refused(command, work, "--other-video-ok", video="hdr.mkv")
    whole = (work / "film.mkv").read_bytes()
    (work / "cut.mkv").write_bytes(whole[: len(whole) // 2])
    refused(command, work, "--other-video-ok", video="cut.mkv")
