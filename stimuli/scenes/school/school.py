"""The school: library, corridor, changing room, gym and yard, on a sunny afternoon."""

from __future__ import annotations

from evenlight.stimuli.scenes.model import SceneModel
from evenlight.stimuli.scenes.scene import Scene
from evenlight.stimuli.scenes.school.changing_room import add_changing_room
from evenlight.stimuli.scenes.school.corridor import add_corridor
from evenlight.stimuli.scenes.school.gym import add_gym
from evenlight.stimuli.scenes.school.library import add_library
from evenlight.stimuli.scenes.school.yard import add_yard


def school(seed: int) -> Scene:
    """Return the school.

    Parameters
    ----------
    seed : int
        Of all that is random in it: which books stand where, what lies about, how the trees have grown.
    """
    model = SceneModel("school", seed)
    model.sun(azimuth=207.0, altitude=38.0, illuminance=1150.0, colour=(1.0, 0.92, 0.78))
    model.sky(zenith=(26.0, 42.0, 76.0), horizon=(72.0, 82.0, 92.0))
    for add in (add_library, add_corridor, add_changing_room, add_gym, add_yard):
        add(model)
    return model.build()
