"""What a track wants of a backlight: the luminance that its limit is about, and the limit itself."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from example_tracks import example_track, header_of

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import sha256_of_record
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack
from evenlight.data_schema.tracks.film_reading import FilmReading
from evenlight.data_schema.tracks.loaded_track import LoadedTrack
from evenlight.experiments.follow.limited_backlight import film_light, track_rate_limit
from evenlight.method.detectability import limit_at_share
from evenlight.method.preset_files import load_display, load_rate_limit

FLAT = RateLimit("flat", "d", "", RateLimitForm.RATE, (2.0,), (1e-3, 1000.0))  # 2 cd/m^2/s at any luminance


def a_track(**changed: Any) -> BrightnessTrack:
    """Two frames of 50 and 60 cd/m^2 at full brightness, at 0.5 and 0.6, with 4 cd/m^2 of reflected light."""
    display = replace(load_display("varjo-xr3"), reflected_luminance=4.0)
    header = header_of(display, rate_limit="surace2025", display=display)
    columns = {"rate": np.array([0.1 * 55 / 0.04, 0.0]), "header": header} | changed
    return example_track([0.5, 0.6], mean_luminance=[0.5 * 50 + 4, 0.6 * 60 + 4], **columns)


def test_the_luminance_is_what_the_frame_emits_at_full_brightness_or_that_of_white() -> None:
    track = a_track()
    assert track.header.display is not None
    for modulated, luminance in (("frame_mean", [50.0, 60.0]), ("white_field", [104.4, 104.4])):
        loaded = LoadedTrack(track, 0.5, "test", modulated=modulated)
        late = film_light(
            loaded, track.header.display, FilmReading(picture_start=0.5)
        )  # on the clock of the file
        np.testing.assert_allclose(late.luminance, luminance)
        np.testing.assert_allclose(late.times, 0.5 + np.asarray(track.times))


def test_the_rate_limit_is_the_one_of_the_track(tmp_path: Path) -> None:
    track = a_track()
    assert track_rate_limit(track, None) == load_rate_limit("surace2025")
    lab = replace(
        track.header, rate_limit="lab", provenance=Provenance(inputs={"rate_limit": sha256_of_record(FLAT)})
    )
    with pytest.raises(InputError, match="'lab', which is no preset"):
        track_rate_limit(a_track(header=lab), None)
    write_json_record(tmp_path / "flat.json", FLAT)
    assert track_rate_limit(a_track(header=lab), str(tmp_path / "flat.json")) == FLAT
    moved = replace(lab, noticed=0.5)  # made for half of the detections: so it is followed, or as asked
    for asked, share in ((None, 0.5), (0.25, 0.25)):
        found = track_rate_limit(a_track(header=moved), str(tmp_path / "flat.json"), asked)
        assert found == limit_at_share(FLAT, share)
    with pytest.raises(InputError, match="surace2025 is another one"):
        track_rate_limit(a_track(header=lab), "surace2025")
