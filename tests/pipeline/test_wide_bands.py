"""A rate limit that is known too badly: written, but refused for use unless that is accepted."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

import evenlight
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import BandKind, RateLimit
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.data_schema.tracks.brightness_track import read_track
from evenlight.experiments.playback.live_record import LiveDimming
from evenlight.experiments.playback.play_options import LiveOptions
from evenlight.method.preset_files import load_display, load_rate_limit, usable_limit
from evenlight.method.rate_limit import require_known

pytestmark = pytest.mark.usefixtures("blank_pictures")


def with_band(lower: float, upper: float) -> RateLimit:
    """The paper's limit with another band, narrow but at one luminance."""
    limit = load_rate_limit("surace2025")
    low, high = limit.luminance_range
    return dataclasses.replace(
        limit,
        name="two people",
        band_luminance=(low, 50.0, high),
        band_lower=(0.2, lower, 2.0),
        band_upper=(0.4, upper, 4.0),
        band_kind=BandKind.SIMULTANEOUS,
    )


@pytest.fixture
def wide(tmp_path: Path) -> Path:
    path = tmp_path / "wide.rate_limit.json"
    write_json_record(path, with_band(0.05, 287.0))
    return path


@pytest.mark.parametrize(
    "arguments",
    [("optimize", "--budget", 0.5), ("control", "--target-loss", 0.05)],
    ids=["optimize", "control"],
)
def test_a_wide_band_is_refused_with_its_numbers_and_the_way_out(
    command, tmp_path: Path, wide: Path, arguments: tuple[object, ...]
) -> None:
    name, *options = arguments
    asked = (name, "checkerboard", "--fps", 2, "--rate-limit", wide, "--out", tmp_path / "out", *options)
    result = command(*asked)
    assert result.code == 2
    assert "at 50 cd/m^2 its 95 % simultaneous band reaches from 0.05 to 287 cd/m^2/s" in result.err
    assert "a ratio of 5.74e+03; at most 4" in result.err  # 287 / 0.05 = 5740
    assert "--accept-wide-band" in result.err
    assert result.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_what_uses_it_all_the_same_says_so(command, make_video, tmp_path: Path, wide: Path) -> None:
    film = tmp_path / "film.mkv"
    make_video(film, 0.5 + 0.4 * np.sin(np.arange(12) / 3), (48, 32), 2.0)
    for path, options, said in ((wide, ("--accept-wide-band",), True), ("surace2025", (), False)):
        out = tmp_path / f"out-{said}"
        result = command(
            "optimize", "--no-player", film, "--budget", 0.5, "--rate-limit", path, "--out", out, *options
        )  # fmt: skip
        assert result.code == 0, result.err
        assert json.loads((out / "summary.json").read_text())["wide_band_accepted"] is said
        assert read_track(out / "track.csv").header.wide_band_accepted is said
        assert ("band was accepted" in result.out) is said


def test_a_walk_and_the_python_interface_refuse_it_too(wide: Path) -> None:
    display = load_display("varjo-xr3")
    for use in (
        lambda: LiveDimming.asked_for(LiveOptions(0.05, rate_limit=str(wide)), display, None),
        lambda: evenlight.optimize("checkerboard", 0.5, rate_limit=wide),
        lambda: evenlight.OnlineController(0.05, rate_limit=wide),
    ):
        with pytest.raises(InputError, match=r"not known well enough.*`accept_wide_band`"):
            use()
    accepted = LiveOptions(0.05, rate_limit=str(wide), accept_wide_band=True)
    assert LiveDimming.asked_for(accepted, display, None).limit.name == "two people"


def test_a_ratio_of_four_is_the_widest_that_is_used() -> None:
    require_known(with_band(1.0, 4.0))
    with pytest.raises(InputError, match=r"a ratio of 4\.01"):
        require_known(with_band(1.0, 4.01))


def test_a_band_that_reaches_zero_is_wider_than_any() -> None:
    with pytest.raises(InputError, match="from 0 to 2 cd/m"):
        require_known(with_band(0.0, 2.0))


def test_a_band_that_a_chosen_share_widens_is_told_with_the_share() -> None:
    """The preset's own band is of use; at 10 % its assumed width widens it, which more people don't mend."""
    preset, display = load_rate_limit("surace2025"), load_display("varjo-xr3")
    usable_limit(preset, display)
    with pytest.raises(InputError, match=r"enough where 10 % is noticed: .*choose a share \(`noticed`\)"):
        usable_limit(preset, display, noticed=0.1)


def test_a_limit_without_a_band_passes_as_before() -> None:
    bare = dataclasses.replace(with_band(1.0, 2.0), band_luminance=(), band_lower=(), band_upper=())
    require_known(bare)  # no model of this program gave it
    assert bare.widest_band is None


def test_validate_notes_it_and_finds_nothing_wrong(command, wide: Path) -> None:
    result = command("validate", wide)
    assert result.code == 0
    assert "from 0.05 to 287 cd/m^2/s" in result.out
    assert "refused without --accept-wide-band" in result.out
