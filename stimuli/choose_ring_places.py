"""Chooses where rings are searched for along camera paths.

`python -m evenlight.stimuli.choose_ring_places NAME...`
writes `NAME.rings.json` beside each path. To be run again when a scene or a path has changed: the places are
directions only, and a wall that was moved does not take its ring with it.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.text_files import write_json_record
from evenlight.stimuli.ring_place_files import PATHS, PLACES, SUFFIX, KeypointRings, RingPlaces
from evenlight.stimuli.ring_places import DECIMALS, PlaceRules, RingPlace, choose_places
from evenlight.stimuli.ring_scene import RingScene
from evenlight.stimuli.scenes.camera import Camera
from evenlight.stimuli.scenes.camera_path import CameraPath, path_named
from evenlight.stimuli.scenes.offscreen import offscreen_context
from evenlight.stimuli.scenes.renderer import SceneRenderer
from evenlight.stimuli.scenes.scene import stream
from evenlight.stimuli.scenes.scenes import scene_named
from evenlight.stimuli.scenes.tone import PEAK
from evenlight.stimuli.sequence_format import ENCODING_GAMMA

if TYPE_CHECKING:
    import moderngl

SEED = 1
DEFAULT_RULES = PlaceRules()
# What scenes are made for, at a headset's resolution; other displays show the same places.
DISPLAY = Display("scenes", PEAK, 0.0, ENCODING_GAMMA, pixels_per_degree=24.0)
SIZE = (96, 96)  # of the pictures [pixels]: twice the radius of practice's ring is 40 pixels from the middle


def main() -> None:
    """Write the places of the paths that are named."""
    parser = argparse.ArgumentParser(prog="choose_ring_places", description=__doc__)
    parser.add_argument("paths", nargs="+", metavar="NAME", help="of camera paths")
    parser.add_argument("--seed", type=int, default=SEED)
    options = parser.parse_args()
    context = offscreen_context()
    try:
        for name in options.paths:
            places = places_along(context, path_named(name), options.seed)
            write_json_record(PATHS / f"{name}{SUFFIX}", places)
    except InputError as error:
        raise SystemExit(str(error)) from None
    finally:
        context.release()


def places_along(
    context: moderngl.Context, path: CameraPath, seed: int, rules: PlaceRules = DEFAULT_RULES
) -> RingPlaces:
    """Return the places of rings at the keypoints of a path that suit a search.

    Each keypoint has chance of its own, so that a new one leaves the others as they are.

    Raises
    ------
    InputError
        If around one of them no three places are found.
    """
    scene = scene_named(path.scene)
    rings = RingScene(context, SceneRenderer(context, scene, SIZE), DISPLAY)
    chosen = []
    for name in path.places:
        point = path.keypoint(name)
        camera = Camera(point.position, point.azimuth, point.altitude)
        places = choose_places(scene, rings, camera, rules, stream(seed, f"{path.name}/{name}"))
        chosen.append(_in_file(name, point.azimuth, places))
        print(f"{path.name}/{name}: " + ", ".join(f"{place.luminance:.2f} cd/m^2" for place in places))
    return RingPlaces(path.name, seed, tuple(chosen))


def _in_file(name: str, ahead: float, places: tuple[RingPlace, RingPlace, RingPlace]) -> KeypointRings:
    """Return the places at a keypoint as they are kept: azimuths from its first direction of view."""
    azimuths = [round((place.azimuth - ahead + 180) % 360 - 180, DECIMALS) for place in places]
    altitudes = [round(place.altitude, DECIMALS) for place in places]
    luminances = [round(place.luminance, 3) for place in places]
    return KeypointRings(
        keypoint=name,
        azimuths=tuple(azimuths[:PLACES]),
        altitudes=tuple(altitudes[:PLACES]),
        luminances=tuple(luminances[:PLACES]),
        practice_azimuth=azimuths[PLACES],
        practice_altitude=altitudes[PLACES],
        practice_luminance=luminances[PLACES],
    )


if __name__ == "__main__":
    main()
