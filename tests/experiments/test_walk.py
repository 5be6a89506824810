"""Walking freely in a scene: where keys and mouse lead, and the way that is kept."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evenlight.data_schema.errors import InputError
from evenlight.experiments.playback.play_options import LiveOptions, WalkOptions
from evenlight.experiments.playback.walk import EYE_HEIGHT, SPEED, Walker, moved, start_in, write_path
from evenlight.experiments.playback.walk_request import require_walk
from evenlight.stimuli.scenes.content.catalogue import path_named
from evenlight.stimuli.scenes.engine.model import SceneModel
from evenlight.stimuli.scenes.engine.scene import Material, Scene

NOTHING = (0.0, 0.0)


@pytest.fixture(scope="module")
def room() -> Scene:
    """A floor of 10 by 6 m at a height of 1 m."""
    model = SceneModel("room", seed=1)
    paper = Material("paper", lambda _, size: np.ones((size, size, 3), np.float32), tile=1.0)
    model.quad([(0, 0, 1), (10, 0, 1), (10, 6, 1), (0, 6, 1)], paper)
    model.walkable((0.0, 0.0), (10.0, 6.0), floor_z=1.0)
    return model.build()


MIDDLE = Walker((5.0, 3.0, 1.0 + EYE_HEIGHT), azimuth=90.0)  # looks east


@pytest.mark.parametrize(
    ("keys", "metres"),
    [
        ({"w"}, (SPEED, 0.0)),
        ({"up"}, (SPEED, 0.0)),
        ({"s"}, (-SPEED, 0.0)),
        ({"d"}, (0.0, -SPEED)),  # to the right of east is south
        ({"a"}, (0.0, SPEED)),
        ({"w", "a"}, (SPEED / 2**0.5, SPEED / 2**0.5)),  # no faster askew
        ({"w", "lshift"}, (2 * SPEED, 0.0)),
        ({"w", "s"}, (0.0, 0.0)),
        ({"x"}, (0.0, 0.0)),
    ],
)
def test_keys_lead_where_the_eye_looks(room: Scene, keys: set[str], metres: tuple[float, float]) -> None:
    after = moved(MIDDLE, frozenset(keys), NOTHING, 1.0, room)
    wanted = (5.0 + metres[0], 3.0 + metres[1], 1.0 + EYE_HEIGHT)
    assert after.position == pytest.approx(wanted, abs=1e-9)
    assert (after.azimuth, after.altitude) == (90.0, 0.0)


def test_arrows_turn_by_a_right_angle_in_a_second_and_the_mouse_by_its_pixels(room: Scene) -> None:
    turned = moved(MIDDLE, frozenset({"left"}), NOTHING, 1.0, room)
    assert turned.azimuth == pytest.approx(0.0)
    looked = moved(MIDDLE, frozenset(), (-1000.0, 50.0), 0.02, room)
    assert (looked.azimuth, looked.altitude) == pytest.approx((350.0, 5.0))  # 0.1 degrees a pixel
    assert moved(MIDDLE, frozenset(), (0.0, 5000.0), 0.02, room).altitude == 80.0
    assert looked.position == MIDDLE.position


def test_nobody_leaves_the_room(room: Scene) -> None:
    walker = MIDDLE
    for _ in range(100):
        walker = moved(walker, frozenset({"w", "lshift"}), NOTHING, 0.1, room)
    assert 9.9 <= walker.position[0] <= 10.03  # as near to the edge as a stride leads


def test_a_walk_begins_upright_on_the_ground(room: Scene) -> None:
    assert start_in(room).position == (5.0, 3.0, 1.0 + EYE_HEIGHT)


def test_the_way_is_a_camera_path_that_leads_where_the_walker_was(tmp_path: Path, room: Scene) -> None:
    """10 s, 50 refreshes a second, straight on for 2 m and turning: kept twice a second."""
    walker, way = Walker((1.0, 1.0, 2.65), 350.0), []
    for k in range(501):
        way.append((k / 50, walker))
        walker = dataclasses.replace(
            walker, position=(1.0 + 0.004 * (k + 1), 1.0, 2.65), azimuth=(350.0 + 0.1 * (k + 1)) % 360
        )
    file = tmp_path / "walk.json"
    write_path(file, "house", way)
    path = path_named(str(file))
    assert (path.scene, path.duration, len(path.keypoints)) == ("house", 10.0, 21)
    for time in (0.0, 0.31, 4.99, 10.0):
        camera = path.camera(time)
        assert camera.position == pytest.approx((1.0 + 0.2 * time, 1.0, 2.65), abs=0.01)
        assert camera.azimuth == pytest.approx((350.0 + 5.0 * time) % 360, abs=0.1)


PLAIN = WalkOptions(scene="house", factor=1.0, seconds=2.0)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"scene": "castle"}, "no scene 'castle' to walk in: there are house, school"),
        ({"factor": 0.0}, "--factor must be above 0 and at most 1, got 0"),
        ({"seconds": -1.0}, "--seconds must be above 0, got -1"),
        ({"seconds": None, "simulate": True}, "give --seconds"),
        ({"record": Path("way.csv")}, r"give a file that ends in \.json"),
        ({"field_of_view": 500.0}, "--field-of-view must lie in"),
        ({"rig": "desk.rig.toml", "size": "64x36"}, "the rig has a size of its own"),
    ],
)
def test_what_cannot_be_walked_is_refused_in_one_line(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError, match=says):
        require_walk(dataclasses.replace(PLAIN, **changes), LiveOptions())
