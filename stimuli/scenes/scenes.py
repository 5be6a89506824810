"""The scenes by name; a new one gets a line in the table."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from functools import lru_cache

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.scenes.scene import Scene

SEED = 1
# Module and function that build each, for a seed.
SCENES = {
    "house": ("house", "house"),
    "school": ("school", "school"),
}


@lru_cache(maxsize=2)
def scene_named(name: str, seed: int = SEED) -> Scene:
    """Return a scene.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    if name not in SCENES:
        raise InputError(f"no scene {name!r}: there are {', '.join(SCENES)}")
    module, function = SCENES[name]
    build: Callable[[int], Scene] = getattr(
        importlib.import_module(f"evenlight.stimuli.scenes.{module}"), function
    )
    return build(seed)
