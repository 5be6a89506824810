"""What the school is made of."""

from __future__ import annotations

from evenlight.stimuli.scenes.scene import Material
from evenlight.stimuli.scenes.textures.cloth import fabric
from evenlight.stimuli.scenes.textures.garden import bark, grass, leaves
from evenlight.stimuli.scenes.textures.printed import landscape_painting
from evenlight.stimuli.scenes.textures.school import (
    basketball_net,
    catalogue_drawers,
    ceiling_tiles,
    chain_link,
    clock_face,
    cork,
    drawn,
    gym_floor,
    library_spines,
    locker_fronts,
    plain,
    spokes,
)
from evenlight.stimuli.scenes.textures.school_pictures import (
    POSTERS,
    basketball,
    dim_classroom,
    exit_sign,
    four_square,
    globe_map,
    hopscotch,
    keyboard,
    name_board,
    number_snail,
    on_the_ground,
    paper_sheets,
    scoreboard,
    screen,
    shelf_marks,
)
from evenlight.stimuli.scenes.textures.tileable import linear
from evenlight.stimuli.scenes.textures.walls import (
    asphalt,
    brick,
    concrete,
    metal,
    paving,
    planks,
    plaster,
    terrazzo,
    tiles,
    wood,
)

# Surfaces of the building.
BRICK = Material("brick", brick(linear("a2553c"), linear("7f3f2e"), linear("b8ae9e")), 0.9)
CONCRETE = Material("concrete", concrete(linear("b5b0a6")), 2.5)
HALL_WALL = Material("hall wall", plaster(linear("e2d6b8")), 2.0)
CORRIDOR_WALL = Material("corridor wall", plaster(linear("e6e0cc")), 2.0)
DADO = Material("dado", plain("4f7f86", 0.1), 1.0, gloss=0.15)
STACKS_WALL = Material("stacks wall", plaster(linear("a89f8c"), 0.1), 2.0)
GYM_WALL = Material("gym wall", plaster(linear("dcd8cc")), 2.0)
GYM_PANELS = Material("gym panels", planks(linear("c79a62"), linear("a87a45"), 10), 1.2, gloss=0.1)
TERRAZZO = Material(
    "terrazzo",
    terrazzo(linear("b5ad9d"), tuple(linear(c) for c in ("6e6459", "e8e2d4", "8c7b66", "4a4a48", "a58467"))),
    1.2,
    gloss=0.3,
)
PARQUET = Material("parquet", planks(linear("a9713f"), linear("7a4a26")), 1.2, gloss=0.2)
STACKS_FLOOR = Material("linoleum", plain("5c5346", 0.25, 24), 1.0, gloss=0.1)
WALL_TILES = Material("wall tiles", tiles(linear("d8e2dc"), linear("9aa09a"), 8), 1.2, gloss=0.25)
FLOOR_TILES = Material("floor tiles", tiles(linear("8a7a68"), linear("4f4840"), 6, 0.2), 1.2, gloss=0.15)
CEILING = Material("ceiling tiles", ceiling_tiles, 1.2)
GYM_FLOOR = Material("gym floor", gym_floor, 2.4, gloss=0.35)
ASPHALT = Material("asphalt", asphalt(linear("7b7977")), 2.0)
GRASS = Material("grass", grass(linear("7d9a45"), linear("3f5a22")), 1.5)
PAVING = Material("paving", paving(linear("a8a196"), 4), 2.0)
HEDGE = Material("hedge", grass(linear("4f6a30"), linear("2a3f1a")), 0.8)
GLASS = Material("pane", plain("1c2830", 0.3, 3), 3.0, gloss=0.9)

# Things are tinted, so that one coat of paint serves for all colours.
PAINT = Material("paint", plain("f4f4f4", 0.06), 0.8)
ENAMEL = Material("enamel", plain("f4f4f4", 0.05), 0.8, gloss=0.35)
VINYL = Material("vinyl", plain("f0f0f0", 0.14, 12), 0.7, gloss=0.12)
CLOTH = Material("cloth", fabric(linear("e8e8e8")), 0.4)
OAK = Material("oak", wood(linear("b07d48"), linear("7b5029")), 0.8, gloss=0.08)
DARK_OAK = Material("dark oak", wood(linear("6f4526"), linear("452814")), 0.8, gloss=0.12)
BEECH = Material("beech", wood(linear("d8b078"), linear("b98a52")), 0.8, gloss=0.08)
STEEL = Material("steel", metal(linear("9aa0a4")), 1.0, gloss=0.3)
BRASS = Material("brass", plain("b3924c", 0.1), 0.5, gloss=0.4)
PAPER = Material("book edges", plain("d9cfb6", 0.2, 32), 0.3)

# Drawn things: one tile is the whole.
SPINES = Material("spines", library_spines, 1.0)
LOCKERS = Material("lockers", locker_fronts(("#3f6f8f", "#3f6f8f", "#39647f", "#477a99")), 1.2, gloss=0.15)
RED_LOCKERS = Material(
    "red lockers", locker_fronts(("#a8483a", "#b8523f", "#9f4236", "#a8483a")), 1.2, gloss=0.15
)
CATALOGUE = Material("catalogue", catalogue_drawers, 1.0)
SHELF_MARKS = Material("shelf marks", drawn("#e8e2cc", shelf_marks), 1.0)
CLOCK = Material("clock", clock_face, 1.0)
CORK = Material("cork", cork, 0.6)
PAPERS = Material("papers", paper_sheets, 1.0)
GLOBE = Material("globe", globe_map, 1.0, gloss=0.2)
SCREEN = Material("screen", drawn("#111111", screen, 0.0), 1.0)
KEYBOARD = Material("keyboard", drawn("#191a1c", keyboard), 1.0)
SCOREBOARD = Material("scoreboard", drawn("#000000", scoreboard, 0.0), 1.0)
EXIT_SIGN = Material("exit sign", drawn("#1f8a4c", exit_sign, 0.0), 1.0)
CLASSROOM = Material("classroom", drawn("#1d2226", dim_classroom), 1.0, gloss=0.5)
SIGN = Material("sign", drawn("#1f3d38", name_board, 0.02), 1.0)
BASKETBALL = Material("basketball", basketball, 1.0)
WALL_POSTERS = {kind: Material(f"{kind} poster", texture, 1.0) for kind, texture in POSTERS.items()}
PAINTING = Material(
    "painting", landscape_painting(linear("9fb8cc"), linear("4f5f38"), linear("e8c98a")), 1.0, gloss=0.1
)
HOPSCOTCH = Material("hopscotch", on_the_ground(hopscotch), 1.0, cutout=True)
SNAIL = Material("number snail", on_the_ground(number_snail), 1.0, cutout=True)
FOUR_SQUARE = Material("four square", on_the_ground(four_square), 1.0, cutout=True)

# With holes.
FENCE = Material("chain link", chain_link, 0.6, cutout=True)
NET = Material("net", basketball_net, 1.0, cutout=True)
SPOKES = Material("spokes", spokes, 1.0, cutout=True)
LEAVES = Material("leaves", leaves(linear("8fae4a"), linear("3c5a24")), 0.9, cutout=True)
BARK = Material("bark", bark(linear("6a5a48")), 0.6)
