"""Chooses where rings are searched for along built-in camera paths (evenlight.stimuli.rings.chosen_places).

`python examples/choose_ring_places.py NAME...` writes `NAME.rings.json` beside each camera path. Run
it again when a scene or a path has changed: the places are directions only, and a wall that was moved does
not take its ring with it. Along a path of one's own they are chosen when a search first asks for them.
"""

from __future__ import annotations

import argparse

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.stimuli.rings.chosen_places import SEED, places_along
from evenlight.stimuli.rings.ring_scene import SUFFIX
from evenlight.stimuli.scenes.content.catalogue import PATHS, path_named


def main() -> None:
    """Write the places of the paths that are named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("paths", nargs="+", metavar="NAME", help="of camera paths")
    parser.add_argument("--seed", type=int, default=SEED)
    options = parser.parse_args()
    try:
        for name in options.paths:
            places = places_along(path_named(name), options.seed)
            write_json_record(PATHS / f"{name}{SUFFIX}", places)
            for each in places.keypoints:
                levels = (*each.luminances, each.practice_luminance)
                print(f"{name}/{each.keypoint}: " + ", ".join(f"{level:.2f} cd/m^2" for level in levels))
    except InputError as error:
        raise SystemExit(str(error)) from None


if __name__ == "__main__":
    main()
