"""Camera paths as JSON: what a file says, checked, and the light of a scene in the same words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.text_files import parse_json
from evenlight.stimuli.scenes.engine.camera_path import CameraPath, Keypoint
from evenlight.stimuli.scenes.engine.scene import Ground, Sky, Sun, Vector

KEYPOINT = ("position_m", "name", "time_s", "azimuth_deg", "altitude_deg")
SKY = ("zenith_cd_m2", "horizon_cd_m2")
GROUND = ("low_m", "high_m", "floor_m")
STEEPEST = 1.0  # slope of ground to walk on
SUN = ("azimuth_deg", "altitude_deg", "illuminance_lx")


def path_from_text(name: str, text: str, scene: str = "") -> CameraPath:
    """Return the path that a JSON text describes, through a scene in place of its own if one is given.

    Raises
    ------
    InputError
        If it cannot be used.
    """
    try:
        content = parse_json(text, f"camera path {name}", "a camera path")
        needed = ("duration_s", "keypoints") if scene else ("scene", "duration_s", "keypoints")
        _check_keys(content, "", needed, ("scene", "places", "sky", "sun", "walkable"))
        for key in ("keypoints", "places", "walkable"):
            if not isinstance(content.get(key, []), list):
                raise ValueError(f"need a list as {key!r}, got {content[key]!r:.40}")
        if not isinstance(content.get("scene", ""), str):
            raise ValueError(f"need the name of a scene as 'scene', got {content['scene']!r:.40}")
        (duration,) = _numbers(content, "", "duration_s")
        return CameraPath(
            name,
            scene or content["scene"],
            duration,
            tuple(_keypoint(point, number) for number, point in enumerate(content["keypoints"], start=1)),
            tuple(str(place) for place in content.get("places", ())),
            text,
            *light_in(content),
            tuple(_ground(entry, k) for k, entry in enumerate(content.get("walkable", ()), start=1)),
        )
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"camera path {name}: {error}") from None


def _keypoint(entry: Any, number: int) -> Keypoint:
    named = isinstance(entry, dict) and "name" in entry
    where = f"keypoint {str(entry['name'])!r:.40}: " if named else f"keypoint {number}: "
    _check_keys(entry, where, KEYPOINT)
    x, y, z = _numbers(entry, where, "position_m", 3)
    time, azimuth, altitude = (_numbers(entry, where, key)[0] for key in KEYPOINT[2:])
    return Keypoint(str(entry["name"]), time, (x, y, z), azimuth, altitude)


def _ground(entry: Any, number: int) -> Ground:
    where = f"walkable {number}: "
    _check_keys(entry, where, GROUND, ("slope",))
    (west, south), (east, north) = (_numbers(entry, where, key, 2) for key in GROUND[:2])
    if not (west < east and south < north):
        raise ValueError(f"{where}need low_m below high_m, got {entry['low_m']} and {entry['high_m']}")
    along, across = _numbers(entry, where, "slope", 2) if "slope" in entry else (0.0, 0.0)
    if max(abs(along), abs(across)) > STEEPEST:
        raise ValueError(f"{where}need slopes of {STEEPEST:g} at most, got {entry['slope']}")
    (floor,) = _numbers(entry, where, "floor_m")
    return Ground((west, south), (east, north), floor, (along, across))


def light_in(content: dict[str, Any]) -> tuple[Sky | None, Sun | None]:
    """Return the sky and the sun that a table describes, None for what is not in it.

    Raises
    ------
    ValueError
        If one cannot be used.

    >>> light_in({"sky": {"zenith_cd_m2": [1, 2, 4], "horizon_cd_m2": [8, 8, 8]}})
    (Sky(zenith=(1.0, 2.0, 4.0), horizon=(8.0, 8.0, 8.0)), None)
    """
    sky, sun = content.get("sky"), content.get("sun")
    above = None
    if sky is not None:
        _check_keys(sky, "the sky: ", SKY)
        above = Sky(*(_colour(sky, "the sky: ", key) for key in SKY))
    if sun is None:
        return above, None
    _check_keys(sun, "the sun: ", SUN, ("colour",))
    azimuth, altitude, illuminance = (_numbers(sun, "the sun: ", key)[0] for key in SUN)
    colour = _colour(sun, "the sun: ", "colour") if "colour" in sun else (1.0, 1.0, 1.0)
    if not (0 < altitude <= 90 and illuminance > 0 and any(colour)):
        raise ValueError(f"need a sun above the horizon that shines, got {sun}")
    return above, Sun(azimuth, altitude, illuminance, colour)


def table_of_light(sky: Sky, sun: Sun | None) -> dict[str, Any]:
    """Return the table that `light_in` reads."""
    above = dict(zip(SKY, (sky.zenith, sky.horizon), strict=True))
    if sun is None:
        return {"sky": above}
    place = dict(zip(SUN, (sun.azimuth, sun.altitude, sun.illuminance), strict=True))
    return {"sky": above, "sun": place | {"colour": sun.colour}}


def _check_keys(entry: Any, where: str, needed: Sequence[str], optional: Sequence[str] = ()) -> None:
    if not isinstance(entry, dict):
        raise ValueError(f"{where}need a table with {', '.join(needed)}, got {entry!r:.40}")
    known = dict.fromkeys([*needed, *optional])
    unknown = [key for key in entry if key not in known]
    if unknown:
        names = ", ".join(f"{key!r:.40}" for key in unknown[:5])
        raise ValueError(f"{where}{names} is unknown; there are {', '.join(known)}")
    for key in needed:
        if key not in entry:
            raise ValueError(f"{where}there is no {key!r}")


def _numbers(entry: dict[str, Any], where: str, key: str, count: int = 1) -> list[float]:
    values = entry[key] if count > 1 else [entry[key]]
    right = isinstance(values, list) and len(values) == count
    if not right or not all(type(value) in (int, float) and abs(value) < 1e300 for value in values):
        need = f"{count} numbers" if count > 1 else "a number"
        raise ValueError(f"{where}need {need} as {key!r}, got {entry[key]!r:.60}")
    return [float(value) for value in values]


def _colour(entry: dict[str, Any], where: str, key: str) -> Vector:
    red, green, blue = _numbers(entry, where, key, 3)
    if min(red, green, blue) < 0:
        raise ValueError(f"{where}need red, green and blue of 0 or above as {key!r}, got {entry[key]}")
    return red, green, blue
