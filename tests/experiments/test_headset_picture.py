"""How wide a video is seen in a headset, and which tracks go with it."""

import math
from pathlib import Path

import numpy as np
import pytest

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.tracks.brightness_track import BudgetUnit, TrackHeader
from evenlight.experiments.playback.headset_picture import require_as_analysed, seen_in_headset, words_of
from evenlight.experiments.playback.play_options import HeadsetOptions, Projection
from evenlight.stimuli.eyes.surfaces import FlatScreen, Sphere
from evenlight.stimuli.scenes.scene_sequence import SceneSequence, standard_format

HEADSET = Display("headset", 104.4, 0.1, 2.2, pixels_per_degree=12.0)
SIZE = (640, 360)


class Film:
    """A video whose pixels have no angle of their own."""

    name, n_frames = "film", 3


def header(**known: float) -> TrackHeader:
    return TrackHeader(
        "film", "headset", HEADSET.fingerprint, "none", "none", 0.5, BudgetUnit.FACTOR, "none", Provenance(),
        **known,
    )  # fmt: skip


def seen(track: TrackHeader, **asked: object):
    return seen_in_headset(Film(), SIZE, HEADSET, track, HeadsetOptions(**asked))


def test_a_flat_screen_is_as_wide_as_the_track_was_made_for() -> None:
    """At 60 degrees, or at 5.585 pixels per degree, where 640 pixels span a right angle."""
    geometry, screen = seen(header(field_of_view=60.0))
    assert isinstance(screen, FlatScreen)
    assert screen.field_of_view == pytest.approx(60.0)
    assert geometry.pixels_per_degree == pytest.approx(math.radians(320 / math.tan(math.radians(30))))
    _, screen = seen(header(pixels_per_degree=math.radians(320)))
    assert screen.field_of_view == pytest.approx(90.0)
    require_as_analysed(*seen(header(field_of_view=60.0)), "")


def test_side_by_side_each_half_has_its_pixels_at_the_analysed_angle() -> None:
    """Half as many pixels, as far apart, of a right angle: twice the arc tangent of a half."""
    geometry, screen = seen(header(field_of_view=90.0), side_by_side=True)
    assert screen.field_of_view == pytest.approx(2 * math.degrees(math.atan(0.5)))
    assert screen.side_by_side
    require_as_analysed(geometry, screen, "")
    assert words_of("film", geometry, screen, 12.0).endswith("has 12, a half of the video for each eye")


def test_another_width_is_refused_with_the_one_that_fits() -> None:
    wide = seen(header(field_of_view=60.0), screen_field_of_view=90.0)
    with pytest.raises(InputError, match=r"shows it at 5\.59, 90° wide: .* --screen-field-of-view 60, or so"):
        require_as_analysed(*wide, ", or so")
    with pytest.raises(InputError, match=r"the track does not say .* give --screen-field-of-view"):
        seen(header())
    require_as_analysed(
        *seen(header(), screen_field_of_view=40.0), ""
    )  # of an angle that nothing is known of
    with pytest.raises(InputError, match="1 to 150 degrees wide, got 170"):
        seen(header(), screen_field_of_view=170.0)


@pytest.mark.parametrize(
    ("span", "side_by_side", "density"), [(360, False, 640 / 360), (180, True, 320 / 180)]
)
def test_a_sphere_has_as_many_pixels_per_degree_all_around(
    span: int, side_by_side: bool, density: float
) -> None:
    asked = {"projection": Projection(str(span)), "side_by_side": side_by_side}
    geometry, sphere = seen(header(pixels_per_degree=density), **asked)
    assert sphere == Sphere(float(span), side_by_side=side_by_side)
    assert geometry.pixels_per_degree == pytest.approx(density)
    require_as_analysed(geometry, sphere, "")
    with pytest.raises(InputError, match=f"with pixels_per_degree = {density:.4g} in its file, or so"):
        require_as_analysed(*seen(header(field_of_view=60.0), **asked), ", or so")
    with pytest.raises(InputError, match="--screen-field-of-view is for --projection flat"):
        seen(header(field_of_view=60.0), screen_field_of_view=60.0, **asked)


def test_a_scene_is_drawn_at_its_true_size_and_lies_on_nothing(tmp_path: Path) -> None:
    house = SceneSequence(standard_format("house"), "house")
    track = header(field_of_view=90.0)
    geometry, surface = seen_in_headset(house, SIZE, HEADSET, track, HeadsetOptions())
    assert surface is None
    require_as_analysed(geometry, surface, "")
    fine, _ = seen_in_headset(house, SIZE, HEADSET, header(pixels_per_degree=60.0), HeadsetOptions())
    require_as_analysed(fine, surface, "")
    says = words_of("house", fine, surface, 1.39)
    assert says.endswith("1.39 pixels per degree, its track was made for 60")
    with pytest.raises(InputError, match="--projection is for videos"):
        seen_in_headset(house, SIZE, HEADSET, track, HeadsetOptions(projection=Projection.WHOLE))
    assert np.isfinite(geometry.pixels_per_degree)
