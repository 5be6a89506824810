"""A dimmed video is the definition, frame by frame, in every codec; and keeps what else its file holds."""

import shutil
import subprocess
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from tracked_videos import BT601, DISPLAY, decoded_planes, film, smooth_planes, track_of

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.dimmed.apply_options import AppliedVersion, Codec, DimmedFile
from evenlight.stimuli.dimmed.apply_video import apply_track
from evenlight.stimuli.dimmed.dimmed_samples import (
    FRACTION,
    cut_above_white,
    dimmed_codes,
    dithered,
    luma_chroma_codings,
    ycbcr_of,
)
from evenlight.stimuli.dimmed.dimming import pixel_scale
from evenlight.stimuli.dimmed.encoders import codec_for
from evenlight.stimuli.dimmed.matched_track import match_track
from evenlight.stimuli.sequences import open_video

GAMMA = DISPLAY.gamma
ZERO = (16.0, 128.0, 128.0)  # of Y', Cb, Cr over the limited range, 8 bits


def applied(source, out, version=AppliedVersion.OURS, codec=None, factors=None):
    """Dim a video by a track of its own; return its factors."""
    b = track_of(source, out.parent / "track", factors)
    video = open_video(str(source))
    matched = match_track(video, out.parent / "track")
    apply_track(video, matched, DimmedFile(out, codec or codec_for(out, None), version))
    return b


def planes_as_defined(planes, factor):
    """Y', Cb, Cr of b^(1/γ) (R', G', B'), in float64: the conversion is linear, and keeps 0."""
    k = factor ** (1 / GAMMA)
    return [zero + (plane.astype(np.float64) - zero) * k for plane, zero in zip(planes, ZERO, strict=True)]


def block_means(plane):
    """Means over 8 x 8 pixels."""
    return plane.reshape(plane.shape[0] // 8, 8, plane.shape[1] // 8, 8).mean(axis=(1, 3))


@pytest.mark.parametrize("layout", ["420", "422", "444"])
def test_without_loss_each_sample_is_next_to_the_definition_and_means_are_right(tmp_path, layout):
    pictures = smooth_planes(3, layout=layout)
    source = film(tmp_path / "film.mkv", pictures, f"yuv{layout}p")
    b = applied(source, tmp_path / "out.mkv")
    written = list(decoded_planes(tmp_path / "out.mkv"))
    assert len(written) == 3
    for planes, before, factor in zip(written, pictures, b, strict=True):
        for plane, wanted in zip(planes, planes_as_defined(before, factor), strict=True):
            assert np.abs(plane - 4 * wanted).max() < 1  # codes of 10 bits
            assert abs((plane - 4 * wanted).mean()) < 0.02


@pytest.mark.parametrize(
    ("codec", "name", "scale"),
    [(Codec.H264, "out.mp4", 1), (Codec.HEVC10, "out.mp4", 4), (Codec.AV1, "out.mp4", 4)],
)
def test_each_codec_keeps_the_definition_to_about_a_code(tmp_path, codec, name, scale, capfd):
    pictures = smooth_planes(4)
    source = film(tmp_path / "film.mkv", pictures)
    b = applied(source, tmp_path / name, codec=codec)
    errors = [
        plane / scale - wanted
        for planes, before, factor in zip(decoded_planes(tmp_path / name), pictures, b, strict=True)
        for plane, wanted in zip(planes, planes_as_defined(before, factor), strict=True)
    ]
    # 8 bits: dithering leaves sqrt(1/6) = 0.41 codes, a quantizer step of 3.1 (QP 14) 3.1 / sqrt(12) = 0.9.
    assert np.sqrt(np.mean([np.mean(e**2) for e in errors])) < (1.2 if scale == 1 else 0.8)
    assert capfd.readouterr().err == ""  # encoders introduce themselves, if one lets them


def test_dark_gradients_keep_their_means_where_rounding_makes_bands(tmp_path):
    # Each of 16 codes is 16 pixels wide: rounded after a scale below 1, some neighbours fall onto one code.
    luma = np.tile(np.rint(np.linspace(16, 32, 256)).astype(np.uint8), (48, 1))
    gray = np.full((24, 128), 128, np.uint8)
    source = film(tmp_path / "film.mkv", [[luma, gray, gray]] * 4)
    b = applied(source, tmp_path / "out.mp4", factors=[0.37, 0.38, 0.39, 0.4])
    codings = luma_chroma_codings(8, full=False)[0]
    errors = {"rounded": [], "dithered": [], "h264": []}
    for planes, factor in zip(decoded_planes(tmp_path / "out.mp4"), b, strict=True):
        wanted = planes_as_defined([luma, gray, gray], factor)[0]
        drawn = dithered(dimmed_codes(factor ** (1 / GAMMA), codings, codings)[luma], 8)
        for name, plane in (("rounded", np.rint(wanted)), ("dithered", drawn), ("h264", planes[0])):
            errors[name].append(block_means(plane - wanted))
    rms = {name: float(np.sqrt(np.mean(np.square(e)))) for name, e in errors.items()}
    assert np.abs(errors["dithered"]).max() < 1 / 16
    assert rms["rounded"] > 0.2  # codes; of errors spread over half a code to each side it is 0.29
    assert rms["h264"] < 0.65 * rms["rounded"]


def test_what_is_not_dimmed_keeps_its_samples():
    for bits in (8, 10):
        (luma, chroma, _), (to_luma, to_chroma, _) = (luma_chroma_codings(n, full=False) for n in (8, bits))
        codes = np.tile(np.arange(256, dtype=np.uint8), (8, 1))
        for before, after in ((luma, to_luma), (chroma, to_chroma)):
            drawn = dithered(dimmed_codes(1.0, before, after)[codes], bits)
            np.testing.assert_array_equal(drawn, codes.astype(int) << (bits - 8))


def test_dithering_is_unbiased_and_leaves_whole_codes_alone():
    for share in range(0, 64, 7):
        values = np.full((8, 8), (5 << FRACTION) + share * (1 << FRACTION) // 64, np.uint32)
        assert dithered(values, 8).mean() == pytest.approx(5 + share / 64, abs=1e-12)
    assert (dithered(np.full((8, 8), 255 << FRACTION, np.uint32), 8) == 255).all()


def test_what_is_above_white_is_cut_off_before_it_is_dimmed(tmp_path):
    # Full-size chroma, BT.601. A gray brighter than white, a red whose R' is above 1, and a gray in between.
    luma = np.repeat(np.array([[250, 150, 180]], np.uint8), 16, axis=1)
    red = np.repeat(np.array([[128, 220, 128]], np.uint8), 16, axis=1)
    picture = [np.tile(row, (16, 1)) for row in (luma, np.full_like(red, 128), red)]
    source = film(tmp_path / "film.mkv", [picture], "yuv444p")
    applied(source, tmp_path / "out.mkv", factors=[0.5])
    (planes,) = decoded_planes(tmp_path / "out.mkv")

    def rgb(y, cb, cr):  # ITU-T H.273, 8.3, K_R = 0.299, K_B = 0.114
        y, cb, cr = (y - 16) / 219, (cb - 128) / 224, (cr - 128) / 224
        return np.stack([y + 1.402 * cr, y - 0.344136 * cb - 0.714136 * cr, y + 1.772 * cb])

    before = rgb(*(p.astype(np.float64) for p in picture))
    assert before[0, 0, 0] > 1.05 and before[0, 0, 16] > 1.1  # noqa: PT018 - what the picture is made for
    shown = np.clip(rgb(*(p / 4 for p in planes)), 0, 1)
    wanted = np.clip(before, 0, 1) * pixel_scale(0.5, GAMMA)
    assert np.abs(block_means_of(shown - wanted)).max() < 1 / 255


def block_means_of(channels):
    return np.stack([block_means(channel) for channel in channels])


def test_above_white_is_cut_off_pixel_by_pixel_and_chroma_takes_the_mean():
    # 4:2:0 of an odd size, colours of all kinds, BT.709; in the lower of two strips nothing is above white.
    rng = np.random.default_rng(5)
    luma = rng.integers(16, 250, (47, 33)).astype(np.uint8)
    blue, red = rng.integers(88, 168, (2, 24, 17)).astype(np.uint8)
    luma[32:] = np.minimum(luma[32:], 60)
    kr, kb, before = 0.2126, 0.0722, [luma.copy(), blue.copy(), red.copy()]
    after = cut_above_white([luma, blue, red], luma_chroma_codings(8, full=False), (kr, kb))
    cut = 0
    for row, column in np.ndindex(24, 17):
        cb, cr, pixels = *((float(plane[row, column]) - 128) / 224 for plane in (blue, red)), []
        for i, k in np.ndindex(2, 2):
            y = (float(luma[min(2 * row + i, 46), min(2 * column + k, 32)]) - 16) / 219
            r, b = y + 2 * (1 - kr) * cr, y + 2 * (1 - kb) * cb
            pixels.append([r, (y - kr * r - kb * b) / (1 - kr - kb), b])
        above = np.max(pixels) > 1 + 0.5 / 219
        whole, cut = np.minimum(pixels, 1) if above else pixels, cut + above
        y = [kr * r + (1 - kr - kb) * g + kb * b for r, g, b in whole]
        cb, cr = (np.mean([p[c] - q for p, q in zip(whole, y, strict=True)]) for c in (2, 0))
        for (i, k), value in zip(np.ndindex(2, 2), y, strict=True):
            if 2 * row + i < 47 and 2 * column + k < 33:
                assert abs(after[0][2 * row + i, 2 * column + k] - (16 + 219 * value)) <= 0.501
        assert abs(after[1][row, column] - (128 + 224 * cb / (2 * (1 - kb)))) <= 0.501
        assert abs(after[2][row, column] - (128 + 224 * cr / (2 * (1 - kr)))) <= 0.501
    assert 40 < cut < 200  # of 408
    for plane, kept in zip((luma, blue, red), before, strict=True):
        np.testing.assert_array_equal(plane, kept)


@pytest.mark.parametrize("bits", [8, 16])
def test_rgb_is_dimmed_channel_by_channel(tmp_path, bits):
    top, kind = 2**bits - 1, np.uint8 if bits == 8 else np.uint16
    pixels = np.random.default_rng(3).integers(0, top, (2, 24, 32, 3), endpoint=True).astype(kind)
    folder = tmp_path / "images"
    folder.mkdir()
    for k, picture in enumerate(pixels):
        np.save(folder / f"{k}.npy", picture)
    b = applied(folder, tmp_path / "out.mkv")
    deep = 2 ** max(bits, 10) - 1
    for picture, (green, blue, red), factor in zip(
        pixels, decoded_planes(tmp_path / "out.mkv"), b, strict=True
    ):
        wanted = deep * (picture / top) * pixel_scale(factor, GAMMA)
        assert np.abs(np.stack([red, green, blue], axis=-1) - wanted).max() < 1


def test_rgb_becomes_bt709_of_the_limited_range_for_players(tmp_path):
    folder = tmp_path / "images"
    folder.mkdir()
    colours = np.array([[0, 0, 0], [255, 255, 255], [255, 0, 0], [30, 90, 200]], np.uint8)
    picture = np.tile(np.repeat(colours, 16, axis=0), (32, 1, 1))
    np.save(folder / "0.npy", picture)
    applied(folder, tmp_path / "out.mp4", factors=[1.0])
    with av.open(str(tmp_path / "out.mp4")) as container:
        shown = next(container.decode(video=0))
        assert (shown.format.name, shown.color_range, shown.colorspace) == ("yuv420p", 1, 1)
    y, cb, cr = next(decoded_planes(tmp_path / "out.mp4"))
    for k, (r, g, b) in enumerate(colours / 255):
        luma = 0.2126 * r + 0.7152 * g + 0.0722 * b
        middle = slice(8, 24), slice(16 * k + 6, 16 * k + 10)
        of_chroma = slice(4, 12), slice(8 * k + 3, 8 * k + 5)
        assert y[middle].mean() == pytest.approx(16 + 219 * luma, abs=1)
        assert cb[of_chroma].mean() == pytest.approx(128 + 224 * (b - luma) / 1.8556, abs=1.5)
        assert cr[of_chroma].mean() == pytest.approx(128 + 224 * (r - luma) / 1.5748, abs=1.5)


def test_chroma_of_half_size_lies_left_and_between_rows():
    # Cb of a ramp along x is that of the even columns; of a ramp along y, the mean of two rows.
    x, y = np.meshgrid(np.arange(16) / 32, np.arange(8) / 16)
    blue = np.stack([0 * x, 0 * x, x + y], axis=-1)
    _, cb, _ = ycbcr_of(blue, 1.0, half=True)
    of_blue = (1 - 0.0722) / 1.8556  # Cb of B' = 1 alone
    wanted = of_blue * (np.arange(16)[::2] / 32 + (np.arange(8)[::2, None] + 0.5) / 16)
    np.testing.assert_allclose(cb[:, 1:-1], wanted[:, 1:-1], atol=1e-6)


@pytest.mark.parametrize("name", ["out.mp4", "out.mov", "out.mkv"])
def test_frames_appear_when_they_did_also_at_a_varying_rate(tmp_path, name):
    stamps = [0, 40, 50, 130, 300, 301, 420]  # [ms]
    source = film(tmp_path / "film.mkv", smooth_planes(len(stamps)), stamps=stamps)
    applied(source, tmp_path / name)
    with av.open(str(tmp_path / name)) as container:
        stream = container.streams.video[0]
        times = [picture.pts * stream.time_base for picture in container.decode(stream)]
    assert times == [Fraction(stamp, 1000) for stamp in stamps]


def test_rotation_shape_of_pixels_and_colours_are_kept(tmp_path):
    source = film(
        tmp_path / "film.mkv", smooth_planes(2), codec="libx264", rotation=90, aspect=Fraction(16, 11)
    )
    for name in ("out.mp4", "out.mov"):
        applied(source, tmp_path / name)
        with av.open(str(tmp_path / name)) as container:
            stream = container.streams.video[0]
            picture = next(container.decode(stream))
            tags = picture.color_range, picture.colorspace, picture.color_primaries, picture.color_trc
            assert (picture.rotation, stream.sample_aspect_ratio, tags) == (90, Fraction(16, 11), BT601)
            assert (picture.width, picture.height) == (64, 48)


@pytest.fixture
def film_with_sound(tmp_path: Path) -> Path:
    """Pictures, sound, subtitles, chapters and a title."""
    path, pictures = tmp_path / "rich.mkv", film(tmp_path / "film.mkv", smooth_planes(20))
    (tmp_path / "words.srt").write_text("1\n00:00:00,100 --> 00:00:00,500\nHello\n")
    with (
        av.open(str(pictures)) as of_pictures,
        av.open(str(tmp_path / "words.srt")) as words,
        av.open(str(path), "w") as container,
    ):
        copies = {
            stream: container.add_stream_from_template(stream)
            for stream in (of_pictures.streams.video[0], words.streams.subtitles[0])
        }
        sound = container.add_stream("aac", rate=48000, layout="mono")
        sound.metadata["language"] = "deu"
        container.metadata["title"] = "A film"
        container.set_chapters(
            [{"id": 1, "start": 0, "end": 400, "time_base": Fraction(1, 1000), "metadata": {"title": "One"}}]
        )
        tone = np.sin(np.arange(40000) / 20).astype(np.float32)[None]
        for k in range(0, 40000, 1000):
            piece = av.AudioFrame.from_ndarray(tone[:, k : k + 1000].copy(), "fltp", "mono")
            piece.sample_rate, piece.pts, piece.time_base = 48000, k, Fraction(1, 48000)
            container.mux(sound.encode(piece))
        container.mux(sound.encode())
        for origin, copy in copies.items():
            for packet in origin.container.demux(origin):
                if packet.dts is not None:
                    packet.stream = copy
                    container.mux(packet)
    return path


def streams_of(path):
    """Type, language, and the bytes and times [s] of the packets of each stream but the pictures."""
    with av.open(str(path)) as container:
        packets = {s.index: [] for s in container.streams}
        for packet in container.demux():
            if packet.size:
                packets[packet.stream.index].append((bytes(packet), float(packet.pts * packet.time_base)))
        found = [
            (stream.type, stream.metadata.get("language"), packets[stream.index])
            for stream in container.streams
            if stream.type != "video"
        ]
        return found, container.metadata.get("title"), [c["metadata"] for c in container.chapters()]


def test_sound_subtitles_chapters_and_title_are_copied_bit_by_bit(tmp_path, film_with_sound):
    applied(film_with_sound, tmp_path / "out.mkv")
    before, after = streams_of(film_with_sound), streams_of(tmp_path / "out.mkv")
    assert sorted(kind for kind, *_ in before[0]) == ["audio", "subtitle"]
    assert len(before[0][0][2]) + len(before[0][1][2]) > 30
    assert after == before


def test_what_mp4_cannot_hold_is_said_and_sound_is_kept(tmp_path, film_with_sound):
    track_of(film_with_sound, tmp_path / "track")
    video = open_video(str(film_with_sound))
    matched = match_track(video, tmp_path / "track")
    left_out = apply_track(video, matched, DimmedFile(tmp_path / "out.mp4", Codec.H264))
    assert len(left_out) == 1 and "subtitle" in left_out[0]  # noqa: PT018 - one claim
    sounds = [
        [packet for kind, _, packets in streams_of(path)[0] if kind == "audio" for packet, _ in packets]
        for path in (film_with_sound, tmp_path / "out.mp4")
    ]
    assert sounds[0] == sounds[1] != []


@pytest.mark.parametrize(("trc", "words"), [(16, "HDR (PQ)"), (18, "HDR (HLG)"), (9, "transfer function 9")])
def test_hdr_is_refused_before_anything_is_written(tmp_path, trc, words):
    source = film(tmp_path / "film.mkv", smooth_planes(2), tags=(1, 9, 9, trc))
    with pytest.raises(InputError) as refused:
        applied(source, tmp_path / "sub" / "out.mkv")
    assert words in str(refused.value)
    assert [p.name for p in (tmp_path / "sub").iterdir()] == ["track"]


def test_an_interruption_leaves_nothing_and_keeps_what_was_there(tmp_path):
    source = film(tmp_path / "film.mkv", smooth_planes(4))
    track_of(source, tmp_path / "track")
    out = tmp_path / "results" / "out.mp4"
    out.parent.mkdir()
    out.write_bytes(b"before")
    video = open_video(str(source))

    def stop(frames):
        if frames == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        apply_track(video, match_track(video, tmp_path / "track"), DimmedFile(out, Codec.H264), stop)
    assert out.read_bytes() == b"before"
    assert [p.name for p in out.parent.iterdir()] == ["out.mp4"]


def test_both_versions_are_beside_each_other_ours_left(tmp_path):
    pictures = smooth_planes(3)
    source = film(tmp_path / "film.mkv", pictures)
    b = applied(source, tmp_path / "out.mkv", AppliedVersion.SIDE_BY_SIDE)
    for planes, before, factor in zip(decoded_planes(tmp_path / "out.mkv"), pictures, b, strict=True):
        luma, width = planes[0] / 4, 64
        assert luma.shape == (48, 64 + 8 + 64)
        assert (luma[:, width : width + 8] == 16).all()
        for half, by in ((luma[:, :width], factor), (luma[:, -width:], b.mean())):
            assert np.abs(half - planes_as_defined(before, by)[0]).max() < 0.25


def test_pictures_that_are_turned_stand_beside_each_other_upright(tmp_path):
    source = film(tmp_path / "film.mkv", smooth_planes(2), codec="libx264", rotation=90)
    applied(source, tmp_path / "out.mp4", AppliedVersion.SIDE_BY_SIDE)
    frame = next(open_video(str(tmp_path / "out.mp4")).frames())
    assert frame.shape == (64, 48 + 8 + 48)


@pytest.mark.parametrize("size", [(65, 48), (64, 47)])
def test_odd_sizes_come_whole_in_every_kind_of_file(tmp_path, size):
    source = film(tmp_path / "film.mkv", smooth_planes(2, size, "444"), "yuv444p")
    for name in ("out.mp4", "out.mkv"):
        applied(source, tmp_path / name)
        assert next(open_video(str(tmp_path / name)).frames()).shape == size[::-1]


def test_the_same_film_makes_the_same_file(tmp_path):
    source = film(tmp_path / "film.mkv", smooth_planes(3))
    for name in ("a.mkv", "b.mkv"):
        applied(source, tmp_path / name)
    assert (tmp_path / "a.mkv").read_bytes() == (tmp_path / "b.mkv").read_bytes()


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="needs the program ffmpeg")
def test_ffmpeg_dims_the_same_planes_by_the_same_scale(tmp_path):
    pictures = smooth_planes(2)
    source = film(tmp_path / "film.mkv", pictures)
    applied(source, tmp_path / "ours.mkv", factors=[0.5, 0.5])
    k = 0.5 ** (1 / GAMMA)
    formula = f"lutyuv=y=64+(val-64)*{k}:u=512+(val-512)*{k}:v=512+(val-512)*{k}"
    subprocess.run(
        ["ffmpeg", "-v", "error", "-i", source, "-vf", f"format=yuv420p10le,{formula}", "-c:v", "ffv1",
         tmp_path / "theirs.mkv"],
        check=True,
    )  # fmt: skip
    for ours, theirs in zip(
        *map(decoded_planes, (tmp_path / "ours.mkv", tmp_path / "theirs.mkv")), strict=True
    ):
        for a, b in zip(ours, theirs, strict=True):
            assert np.abs(a - b).max() <= 1  # FFmpeg cuts off what is below a code, of 10 bits


def test_a_film_whose_clock_does_not_begin_at_0_begins_at_0(tmp_path):
    source = film(tmp_path / "film.mkv", smooth_planes(3), stamps=[1400, 1440, 1500])
    applied(source, tmp_path / "out.mkv")
    with av.open(str(tmp_path / "out.mkv")) as container:
        assert [picture.pts for picture in container.decode(video=0)] == [0, 40, 100]
