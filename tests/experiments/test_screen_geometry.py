"""At what angle a video is seen: true size where it is known, and that of its track, or it is refused."""

import math
from dataclasses import dataclass
from typing import Any

import pytest
from seen_points import project

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.tracks.brightness_track import BudgetUnit, TrackHeader
from evenlight.experiments.playback.screen_geometry import ScreenGeometry, shown_size
from evenlight.stimuli.scenes.engine.camera import Camera, focal_length_of

SIZE = (640, 360)
DESK = Display("desk", 250.0, 0.25, 2.2, pixels_per_degree=38.0)
FOCAL = 38 * 180 / math.pi  # 2177 pixels
DENSITY = 320 * math.radians(1)  # pixels per degree in the middle of 640 pixels of 90 degrees: 5.585


@dataclass
class Film:
    """A video that knows its field of view, or none."""

    field_of_view: float | None
    name: str = "film"


def header(**known: Any) -> TrackHeader:
    return TrackHeader("v", "desk", "f", "p", "r", 0.5, BudgetUnit.FACTOR, "s", Provenance(), **known)


def seen(angle: float | None, **known: Any) -> ScreenGeometry:
    return ScreenGeometry.of(Film(angle), SIZE, DESK, header(**known))


def test_a_video_that_knows_its_angle_is_scaled_to_true_size() -> None:
    """A direction 10 degrees off lies 320 tan 10 pixels off in the video, and 2177 tan 10 on the display."""
    shown = seen(90.0)
    assert shown.pixels_per_degree == pytest.approx(DENSITY)
    off = project(
        Camera((0.0, 0.0, 0.0), 0.0, field_of_view=90.0),
        [[math.sin(math.radians(10)), math.cos(math.radians(10)), 0.0]],
        SIZE,
    )[0, 0]
    assert (off - 320) * shown.scale == pytest.approx(FOCAL * math.tan(math.radians(10)))


def test_one_within_a_percent_of_the_display_is_shown_pixel_for_pixel() -> None:
    spans = math.degrees(2 * math.atan(320 / FOCAL))  # 16.7 degrees
    for angle, scale in ((spans, 1.0), (spans * 1.009, 1.0), (spans * 1.03, pytest.approx(1.03, abs=0.001))):
        assert seen(angle).scale == scale


def test_one_that_does_not_know_it_is_shown_pixel_for_pixel_or_as_its_track_says() -> None:
    assert (seen(None).scale, seen(None).pixels_per_degree) == (None, 38.0)
    assert seen(None, field_of_view=90.0).scale == pytest.approx(FOCAL / 320)
    seen(None, field_of_view=90.0, pixels_per_degree=DENSITY).require_as_analysed()


@pytest.mark.parametrize(
    ("video", "track"),
    [
        (90.0, {"field_of_view": 90.0, "pixels_per_degree": DENSITY}),
        (90.0, {"field_of_view": 90.0, "pixels_per_degree": 3.0}),  # averaged for a display of fewer pixels
        (90.0, {"pixels_per_degree": DENSITY}),  # an older file
        (90.0, {"pixels_per_degree": DENSITY * 1.019}),
        (90.0, {}),  # a file that does not say
        (None, {"pixels_per_degree": 38.0}),
    ],
)
def test_a_track_of_the_same_angle_is_taken(video: float | None, track: dict[str, float]) -> None:
    seen(video, **track).require_as_analysed()


@pytest.mark.parametrize(
    ("video", "track", "says"),
    [
        (
            90.0,
            {"pixels_per_degree": 38.0},
            "the track was made for a video seen at 38 pixels per degree, and 'desk' shows it at 5.59, "
            "90° wide: make the track again with --field-of-view 90, or not",
        ),
        (90.0, {"pixels_per_degree": DENSITY * 1.025}, "5.72 pixels per degree, and 'desk' shows it at 5.59"),
        (90.0, {"field_of_view": 40.0}, "seen at 15.3 pixels per degree, and 'desk' shows it at 5.59"),
        (
            None,
            {"pixels_per_degree": 72.28},
            "at 72.3 pixels per degree, and 'desk' shows it at 38, pixel for pixel: make the track again "
            "with this --display, pixel for pixel, or not",
        ),
    ],
)
def test_a_track_of_another_angle_is_refused_with_the_way_out(
    video: float | None, track: dict[str, float], says: str
) -> None:
    with pytest.raises(InputError) as refused:
        seen(video, **track).require_as_analysed(", or not")
    assert says in str(refused.value)


def test_what_the_window_shows_is_said() -> None:
    """1280 pixels at 2177 are 2 atan(640 / 2177) = 32.8 degrees, 720 are 18.8; 4355 would be all of 90."""
    assert seen(90.0).in_words("film", (1280, 720)) == (
        "film: 90° wide; the window shows the middle 32.8° × 18.8° at true size, scaled 6.8 times: "
        "`evenlight render` with --display and --size 1280x720 makes a video for it"
    )
    assert "the middle 32.8° at true size" in seen(90.0).in_words("film", (1280, 3000))
    spans = math.degrees(2 * math.atan(320 / FOCAL))
    assert seen(spans).in_words("film", (1280, 720)) == (
        "film: 16.7° wide; the window shows all of it at true size"
    )
    assert "shows all of its width, 50% of its height, at" in seen(spans).in_words("film", (640, 180))
    finer = seen(90.0).in_words("film", (1280, 720), drawn=True)
    assert finer.endswith("at true size, drawn 6.8 times as fine as its track was made for")
    assert seen(None).in_words("film", (1280, 720)) == "film: pixel for pixel, 38 pixels per degree"


def test_of_a_picture_larger_than_the_window_the_middle_is_shown() -> None:
    assert shown_size(SIZE, FOCAL / 320, (1280, 720)) == (1280, 720)
    assert shown_size(SIZE, 0.5, (1280, 720)) == (320, 180)
    assert focal_length_of(DESK) == pytest.approx(FOCAL)
