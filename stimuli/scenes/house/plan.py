"""The plan of the house: x east, y north, the ground floor at z = 0 [m].

South lies the terrace with the garden, west the porch with the street. The living room takes the south-west,
the kitchen the south-east, the hall the north; stairs run along the north wall, up to the first floor and,
below them, down to the basement.
"""

from __future__ import annotations

from evenlight.stimuli.scenes.house.walls import Opening

GROUND = -0.75  # the lawn; the cellar windows look out just above it
CEILING, EAVES, RIDGE = 2.7, 5.5, 8.3
CELLAR, CELLAR_CEILING = -2.6, -0.28
OUTER_LOW, OUTER_HIGH = (0.0, 0.0), (11.0, 8.0)  # outside of the walls, 0.3 m thick

LIVING = (0.3, 0.3), (6.3, 5.0)
KITCHEN = (6.42, 0.3), (10.7, 5.0)
HALL = (0.3, 5.12), (7.5, 7.7)
BASEMENT = (0.3, 0.3), (8.0, 7.7)
STAIRWELL = (2.4, 6.65), (6.3, 7.7)

GARDEN_WINDOW = Opening(0.8, 3.0, 0.45, 2.35)  # living room, south
TERRACE_DOOR = Opening(3.4, 5.2, 0.0, 2.35)  # living room, south
WEST_WINDOW = Opening(1.5, 3.4, 0.85, 2.2)  # living room, west
SINK_WINDOW = Opening(7.5, 9.6, 1.1, 2.2)  # kitchen, south
EAST_WINDOW = Opening(1.7, 3.7, 0.85, 2.2)  # kitchen, east
FRONT_DOOR = Opening(5.6, 6.55, 0.0, 2.1)  # hall, west
HALL_WINDOW = Opening(6.95, 7.45, 1.0, 2.0)  # hall, west, beside the door
CELLAR_WINDOW = Opening(1.4, 2.7, -0.7, -0.34)  # basement, west
LANDING_WINDOW = Opening(3.9, 5.2, 3.7, 4.8)  # over the stairs, north
ARCH = Opening(2.0, 3.9, 0.0, 2.3)  # between living room and kitchen, along y
LIVING_DOOR = Opening(5.1, 6.0, 0.0, 2.1)  # between living room and hall, along x
KITCHEN_DOOR = Opening(6.55, 7.4, 0.0, 2.1)  # between kitchen and hall, along x
CELLAR_DOOR = Opening(6.72, 7.62, 0.0, 2.05)  # at the head of the cellar stairs, along y

DECK_LOW, DECK_HIGH = (0.6, -3.2), (7.0, 0.0)
GARDEN_STEPS = (3.4, -4.4), (5.2, -3.2)
PORCH_LOW, PORCH_HIGH = (-1.9, 5.1), (0.0, 7.1)
PORCH_STEPS = (-3.1, 5.5), (-1.9, 6.7)
