"""The house: a family's home with garden, living room, kitchen, hall and basement, on a sunny afternoon."""

from __future__ import annotations

from evenlight.stimuli.scenes import house_plan as plan
from evenlight.stimuli.scenes.house_basement import basement
from evenlight.stimuli.scenes.house_garden import garden
from evenlight.stimuli.scenes.house_hall import hall
from evenlight.stimuli.scenes.house_kitchen import kitchen
from evenlight.stimuli.scenes.house_living import living_room
from evenlight.stimuli.scenes.house_shell import shell
from evenlight.stimuli.scenes.house_surroundings import surroundings
from evenlight.stimuli.scenes.model import SceneModel
from evenlight.stimuli.scenes.scene import Scene

SUN_ILLUMINANCE = 620.0  # [lx]; with it sunlit plaster comes near the 100 cd/m^2 of a headset's display
SUN_COLOUR = (1.0, 0.93, 0.80)
ZENITH, HORIZON = (16.0, 30.0, 60.0), (52.0, 62.0, 72.0)


def house(seed: int) -> Scene:
    """Return the house, furnished by a seed."""
    model = SceneModel("house", seed)
    model.sun(228.0, 40.0, SUN_ILLUMINANCE, SUN_COLOUR)
    model.sky(ZENITH, HORIZON)
    shell(model)
    garden(model)
    surroundings(model)
    living_room(model)
    kitchen(model)
    hall(model)
    basement(model)
    _places(model)
    _ground(model)
    return model.build()


def _places(model: SceneModel) -> None:
    """Name the rooms and the outdoors."""
    for name, ((x0, y0), (x1, y1)), low, high in (
        ("living room", plan.LIVING, 0.0, plan.CEILING),
        ("kitchen", plan.KITCHEN, 0.0, plan.CEILING),
        ("hallway", plan.HALL, 0.0, plan.CEILING),
        ("basement", plan.BASEMENT, plan.CELLAR, plan.CELLAR_CEILING),
        ("terrace", (plan.DECK_LOW, plan.DECK_HIGH), -0.02, 3.0),
        ("porch", (plan.PORCH_LOW, plan.PORCH_HIGH), 0.0, 3.0),
        ("stairs", plan.STAIRWELL, plan.CELLAR, plan.CEILING),
        ("garden", ((-4.4, -12.5), (14.8, 0.0)), plan.GROUND, 5.0),
        ("front garden", ((-5.4, 0.0), (0.0, 12.0)), plan.GROUND, 5.0),
    ):
        model.place(name, (x0, y0, low), (x1, y1, high))


def _ground(model: SceneModel) -> None:
    """Say where one may walk: free floor, doorways, stairs."""
    (x0, y0), (x1, y1) = plan.GARDEN_STEPS
    for low, high in (
        ((3.65, 0.95), (5.55, 3.2)),
        ((4.3, 3.0), (5.6, 4.0)),
        ((3.65, 2.3), (6.9, 3.6)),  # living room
        ((1.4, 1.35), (1.75, 3.5)),
        ((2.85, 1.35), (3.8, 3.2)),
        ((1.4, 1.0), (3.8, 1.5)),
        ((5.25, 3.6), (5.85, 5.85)),  # to the hall
        ((6.8, 1.4), (7.7, 3.9)),
        ((7.6, 3.85), (10.2, 4.1)),
        ((6.8, 3.5), (7.3, 5.4)),
        ((6.8, 1.2), (10.3, 1.4)),  # kitchen
        ((0.75, 5.75), (7.15, 6.25)),
        ((0.75, 6.2), (2.0, 6.9)),
        ((6.75, 5.45), (7.2, 7.2)),
        ((6.1, 7.0), (7.2, 7.3)),  # hall
        ((-1.9, 5.9), (0.8, 6.2)),  # porch
        ((x0 + 0.3, -1.0), (x1 - 0.3, 1.2)),
        ((3.1, -2.8), (5.4, -0.9)),  # terrace
    ):
        model.walkable(low, high, 0.0)
    model.walkable(
        (x0 + 0.3, y0), (x1 - 0.3, y1 + 0.4), plan.GROUND, slope=(0.0, -plan.GROUND / (y1 + 0.4 - y0))
    )
    (x0, y0), (x1, y1) = plan.PORCH_STEPS
    model.walkable((x0, y0 + 0.3), (x1, y1 - 0.3), plan.GROUND, slope=(-plan.GROUND / (x1 - x0), 0.0))
    for low, high in (
        ((-3.0, -10.0), (6.5, -4.4)),
        ((6.0, -5.0), (12.0, -4.2)),
        ((-3.0, -10.0), (-2.2, 9.0)),
        ((-6.5, 5.8), (-2.2, 6.4)),
    ):
        model.walkable(low, high, plan.GROUND)
    (a, b), (c, d) = plan.STAIRWELL
    model.walkable((a, b + 0.3), (c - 0.1, d - 0.3), plan.CELLAR, slope=(-plan.CELLAR / (c - 0.1 - a), 0.0))
    for low, high in (
        ((1.1, 6.95), (2.45, 7.4)),
        ((1.3, 5.9), (1.9, 7.4)),
        ((1.5, 1.2), (2.2, 6.1)),
        ((2.1, 1.2), (3.8, 4.8)),
        ((3.7, 2.7), (7.0, 4.0)),
        ((5.0, 2.1), (7.0, 4.0)),
        ((5.2, 3.9), (6.4, 6.3)),
    ):
        model.walkable(low, high, plan.CELLAR)
