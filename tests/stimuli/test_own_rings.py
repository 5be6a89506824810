"""Rings along a path of one's own: chosen once, stored beside it, and refused where they do not serve."""

import dataclasses
import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.rings import chosen_places
from evenlight.stimuli.rings.ring_scene import RingPlaces, ring_places, search_sha256
from evenlight.stimuli.scenes.engine.camera_path import CameraPath


@pytest.fixture
def own_path(tmp_path, monkeypatch) -> Iterator[Path]:
    """A path whose scene is a file, and a choice without drawing: what is stored for the library."""
    found = next(each for each in ring_places("library").keypoints if each.keypoint == "stacks")

    def choose(path: CameraPath) -> RingPlaces:
        return RingPlaces(path.name, 1, tuple(dataclasses.replace(found, keypoint=n) for n in path.places))

    monkeypatch.setattr(chosen_places, "places_along", choose)
    points = [
        {"name": name, "time_s": time, "position_m": [time, 0, 1.6], "azimuth_deg": 0, "altitude_deg": 0}
        for name, time in (("door", 0), ("desk", 1))
    ]
    content = {"scene": "lab.gltf", "duration_s": 1, "keypoints": points, "places": ["desk"]}
    (tmp_path / "lab.gltf").write_text('{"asset": {"version": "2.0"}}')
    (tmp_path / "lab.json").write_text(json.dumps(content))
    yield tmp_path / "lab.json"
    ring_places.cache_clear()


def test_along_a_path_of_ones_own_rings_are_chosen_once_and_then_read(own_path, monkeypatch) -> None:
    chosen = ring_places(str(own_path))
    assert [each.keypoint for each in chosen.keypoints] == ["desk"]
    monkeypatch.delattr(chosen_places, "places_along")
    ring_places.cache_clear()
    assert ring_places(str(own_path)) == chosen


@pytest.mark.parametrize(
    ("file", "was", "now", "said"),
    [
        ("lab.rings.json", '"path": "lab"', '"path": "den"', "they are of the path 'den'; delete it"),
        ("lab.rings.json", '"keypoint": "desk"', '"keypoint": "bed"', "no keypoint 'bed' is on the path"),
        ("lab.json", "1.6", "1.7", "the path or the scene changed"),
        ("lab.gltf", "2.0", "2.00", "the path or the scene changed"),
    ],
)
def test_rings_of_another_path_or_scene_are_refused_and_change_the_hash(
    own_path, file, was, now, said
) -> None:
    ring_places(str(own_path))
    before = search_sha256(str(own_path))
    changed = own_path.parent / file
    changed.write_text(changed.read_text().replace(was, now))
    assert search_sha256(str(own_path)) != before
    ring_places.cache_clear()
    with pytest.raises(InputError, match=rf"lab\.rings\.json: its places of rings do not serve: {said}"):
        ring_places(str(own_path))


def test_a_file_of_rings_needs_keypoints_and_each_once(own_path) -> None:
    (one,) = ring_places(str(own_path)).keypoints
    for keypoints, said in ((), "none"), ((one, one), "desk, desk"):
        with pytest.raises(ValueError, match=f"need keypoints, each once, got {said}"):
            RingPlaces("lab", 1, keypoints)


def test_without_a_folder_to_write_to_no_rings_are_chosen(own_path, monkeypatch) -> None:
    monkeypatch.setattr("os.access", lambda *_: False)
    with pytest.raises(InputError, match=r"lab\.rings\.json: .* need a folder to write to"):
        ring_places(str(own_path))
