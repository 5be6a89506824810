"""Where rings are searched for along a camera path: three places at each keypoint, kept in a file.

The places are chosen once (`stimuli.ring_places`) and kept beside the path, so that every participant and
every laboratory searches for the same rings, and a session needs no rendering before it can be planned.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import sha256_of_bytes
from evenlight.data_schema.quantities import check_limits, described, quantity
from evenlight.data_schema.text_files import read_json_record
from evenlight.stimuli import landolt, ring_light, ring_scene
from evenlight.stimuli.scenes.definition import scenes_sha256

PATHS = Path(__file__).parent / "scenes" / "paths"
SUFFIX = ".rings.json"
PLACES = 2  # at each keypoint: one for each version that a participant sees; there is one more for practice
PRACTICE_SIZE = 2  # of a ring for practice, as a multiple of the design's


@dataclass(frozen=True, slots=True)
class KeypointRings:
    """The places of rings at one keypoint.

    Attributes
    ----------
    keypoint : str
        Its name.
    azimuths, altitudes : tuple of float
        Direction of each place, from the keypoint's first direction of view and from the horizon [deg].
    luminances : tuple of float
        Mean luminance around a ring at each place, on a display of 100 cd/m^2 without black [cd/m^2].
    practice_azimuth, practice_altitude, practice_luminance : float
        The same of a third place, for the larger ring of practice: none of the session's rings lies there.
    """

    keypoint: str = described("name of the keypoint")
    azimuths: tuple[float, ...] = quantity(
        "deg", "of each place, from the keypoint's first direction of view", minimum=-180.0, maximum=180.0
    )
    altitudes: tuple[float, ...] = quantity(
        "deg", "of each place, from the horizon", minimum=-90.0, maximum=90.0
    )
    luminances: tuple[float, ...] = quantity(
        "cd/m^2", "mean luminance around each, on a display of 100 cd/m^2 without black", above=0.0
    )
    practice_azimuth: float = quantity(
        "deg", "of the place for practice, as azimuths", minimum=-180.0, maximum=180.0
    )
    practice_altitude: float = quantity(
        "deg", "of the place for practice, as altitudes", minimum=-90.0, maximum=90.0
    )
    practice_luminance: float = quantity(
        "cd/m^2", "mean luminance around the ring of practice, as luminances", above=0.0
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
    """The places of rings along a camera path; the file `NAME.rings.json` beside it.

    Attributes
    ----------
    path : str
        Name of the camera path.
    seed : int
        Of the choice.
    keypoints : tuple of KeypointRings
        Those of its keypoints that a search uses.
    """

    path: str = described("name of the camera path")
    seed: int = quantity("1", "of the choice", minimum=0)
    keypoints: tuple[KeypointRings, ...] = described("keypoints of a search")


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
