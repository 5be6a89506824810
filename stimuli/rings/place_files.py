"""Where rings are searched for along a camera path: three places at each keypoint, kept in a file.

The places are chosen once (`stimuli.rings.ring_places`) and kept beside the path, so that every participant
and every laboratory searches for the same rings, and a session needs no rendering before it can be planned.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import sha256_of_bytes
from evenlight.data_schema.quantities import check_limits, described, quantity
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.stimuli.rings import landolt, ring_light, ring_scene
from evenlight.stimuli.scenes.array_cache import scenes_sha256
from evenlight.stimuli.scenes.camera_path import PATHS

SUFFIX = ".rings.json"
PLACES = 2  # at each keypoint: one for each version that a participant sees; there is one more for practice
PRACTICE_SIZE = 2  # of a ring for practice, as a multiple of the design's


@dataclass(frozen=True, slots=True)
class KeypointRings:
    """The places of rings at one keypoint."""

    keypoint: str = described("name of the keypoint")
    azimuths: tuple[float, ...] = quantity(
        "deg",
        "azimuth of each place, from the keypoint's first direction of view",
        minimum=-180.0,
        maximum=180.0,
    )
    altitudes: tuple[float, ...] = quantity(
        "deg", "altitude of each place, from the horizon", minimum=-90.0, maximum=90.0
    )
    luminances: tuple[float, ...] = quantity(
        "cd/m^2",
        "mean luminance around a ring at each place, on a display of 100 cd/m^2 without black",
        above=0.0,
    )
    practice_azimuth: float = quantity(
        "deg",
        "azimuth of a third place, for the larger ring of practice: no ring of the session lies there",
        minimum=-180.0,
        maximum=180.0,
    )
    practice_altitude: float = quantity(
        "deg", "altitude of the place for practice, from the horizon", minimum=-90.0, maximum=90.0
    )
    practice_luminance: float = quantity(
        "cd/m^2", "mean luminance around the ring of practice, on the same display", above=0.0
    )

    def __post_init__(self) -> None:
        check_limits(self)
        if not len(self.azimuths) == len(self.altitudes) == len(self.luminances) == PLACES:
            raise ValueError(
                f"need {PLACES} places at each keypoint, got {len(self.azimuths)} azimuths, "
                f"{len(self.altitudes)} altitudes and {len(self.luminances)} luminances"
            )


@dataclass(frozen=True, slots=True)
class RingPlaces:
    """The places of rings along a camera path; the file `NAME.rings.json` beside it."""

    path: str = described("name of the camera path")
    seed: int = quantity("1", "seed of the choice", minimum=0)
    keypoints: tuple[KeypointRings, ...] = described(
        "the keypoints of the path that a search uses, with their places"
    )


def search_sha256(path: str) -> str:
    """Return the SHA-256 of what a search along a camera path shows: scenes, path, rings and their places."""
    rings = (Path(str(module.__file__)) for module in (landolt, ring_light, ring_scene))
    files = (PATHS / f"{path}.json", PATHS / f"{path}{SUFFIX}", *rings)
    return sha256_of_bytes(scenes_sha256().encode() + b"".join(file.read_bytes() for file in files))


def ring_places(path: str) -> RingPlaces:
    """Return where rings are searched for along a built-in camera path.

    Raises
    ------
    InputError
        If there are none.
    """
    file = PATHS / f"{path}{SUFFIX}"
    if not file.is_file():
        known = sorted(each.name.removesuffix(SUFFIX) for each in PATHS.glob(f"*{SUFFIX}"))
        raise InputError(f"no rings are searched for along {path!r}; there is {', '.join(known)}")
    return read_json_record(RingPlaces, file)
