"""What the house is made of.

Plain things share a few white materials and get their colour by a tint.
"""

from __future__ import annotations

from evenlight.stimuli.scenes.content.textures.garden import (
    bark,
    blossoms,
    grass,
    gravel,
    leaves,
    soil,
    thicket,
)
from evenlight.stimuli.scenes.content.textures.interior import (
    asphalt,
    brick,
    carpet,
    checked_fabric,
    chequered_tiles,
    concrete,
    curtain,
    fabric,
    metal,
    painted_boards,
    painted_brick,
    panel_door,
    paving,
    planks,
    plaster,
    roof_tiles,
    rug,
    striped_fabric,
    stripes,
    tiles,
    wood,
)
from evenlight.stimuli.scenes.content.textures.printed import (
    abstract_painting,
    book_spines,
    dial_face,
    framed,
    keyboard,
    label,
    landscape_painting,
    papers,
    perforated,
    poster,
    screen,
)
from evenlight.stimuli.scenes.content.textures.tileable import linear
from evenlight.stimuli.scenes.engine.model import Material

WHITE = linear("f4f2ec")

# Tinted as needed.
PAINT = Material("paint", plaster(WHITE, 0.03), 0.7)
GLAZED = Material("glazed", plaster(WHITE, 0.03), 0.7, gloss=0.75)
CLOTH = Material("cloth", fabric(WHITE), 0.5)
STEEL = Material("steel", metal(WHITE), 0.6, gloss=0.6, metal=1.0)
BOARD = Material("board", wood(linear("f2ece0"), linear("c8bba8")), 0.8)

# Wood
OAK = Material("oak", wood(linear("d0a468"), linear("8a5a2c")), 0.9, gloss=0.3)
WALNUT = Material("walnut", wood(linear("8a5f3e"), linear("42281a")), 0.9, gloss=0.35)
PINE = Material("pine", wood(linear("e2bf88"), linear("b98547"), 12), 0.9)
OLD_WOOD = Material("old wood", wood(linear("a8957a"), linear("6c5c4a"), 14), 0.9)
FLOOR_BOARDS = Material("floor boards", planks(linear("d8ad74"), linear("8f6034")), 1.3, gloss=0.45)
DECK = Material("deck", planks(linear("c4a888"), linear("86684a"), 9), 1.3)
DOOR = Material("door", panel_door(linear("ece6d8"), linear("ddd5c4")), 1.0, gloss=0.25)
FRONT_DOOR = Material("front door", panel_door(linear("3f6b5c"), linear("2f5348")), 1.0, gloss=0.25)
FENCE_BOARDS = Material("fence boards", painted_boards(linear("d8d2c4"), 8), 1.0)
SHED_BOARDS = Material("shed boards", painted_boards(linear("8a5a48"), 7), 1.0)

# Walls and floors
LIVING_WALL = Material("living wall", plaster(linear("efe8d9")), 2.2)
FEATURE_WALL = Material("feature wall", plaster(linear("94b0a8")), 2.2)
CEILING = Material("ceiling", plaster(linear("f2f0ea"), 0.03), 2.5)
HALL_WALL = Material("hall wall", stripes(linear("e2dcc6"), linear("b4bfa4"), 6), 1.1)
KITCHEN_WALL = Material("kitchen wall", plaster(linear("ead9b0")), 2.2)
KITCHEN_TILES = Material("kitchen tiles", tiles(linear("e6ece8"), linear("8f8d86"), 4, 0.06), 0.6, gloss=0.7)
ACCENT_TILES = Material("accent tiles", tiles(linear("4f7f92"), linear("c8c4b8"), 4, 0.3), 0.4, gloss=0.7)
KITCHEN_FLOOR = Material(
    "kitchen floor", chequered_tiles(linear("e8e2d4"), linear("4a5258"), 4), 1.6, gloss=0.5
)
HALL_FLOOR = Material("hall floor", tiles(linear("a8553c"), linear("b8aa96"), 5, 0.3), 1.25, gloss=0.45)
STONE = Material("stone", paving(linear("c4b9a4")), 2.0)
FACADE = Material("facade", plaster(linear("e9e1cd"), 0.14), 2.5)
PLINTH = Material("plinth", concrete(linear("9c978c")), 2.0)
NEIGHBOUR_BRICK = Material(
    "neighbour brick", brick(linear("a25a40"), linear("c07f58"), linear("c4bba8")), 1.0
)
ROOF = Material("roof", roof_tiles(linear("a4553c")), 2.4)
BASEMENT_BRICK = Material("basement brick", painted_brick(linear("e6e3da")), 0.9)
RAW_BRICK = Material("raw brick", brick(linear("a8735f"), linear("b98a72"), linear("b8b2a6")), 0.9)
BASEMENT_FLOOR = Material("basement floor", concrete(linear("aaa69e")), 2.4)
BASEMENT_CEILING = Material("basement ceiling", concrete(linear("dad7ce")), 3.0)

# Cloth
SOFA = Material("sofa", fabric(linear("5d7f8e")), 0.5)
ARMCHAIR = Material("armchair", fabric(linear("c08a3e")), 0.5)
CURTAIN = Material("curtain", curtain(linear("d9c79c")), 0.8)
RUG = Material("rug", rug(linear("8e2f2c"), linear("26385a"), linear("e0cb9c")), 1.0)
RUNNER = Material("runner", rug(linear("2f4f4a"), linear("6e2a26"), linear("d8bd84")), 1.0)
DOORMAT = Material("doormat", carpet(linear("6a5238"), linear("8f7350")), 0.5)
TOWEL = Material("towel", striped_fabric((linear("e8e4da"), linear("3f6f9a"), linear("e8e4da"))), 0.3)
AWNING = Material("awning", striped_fabric((linear("f2ead8"), linear("c65a3a")), 3), 1.2)
GINGHAM = Material("gingham", checked_fabric(linear("f4f0e6"), linear("b8373a")), 0.5)
PLAID = Material("plaid", checked_fabric(linear("3f5a4a"), linear("b8a058"), 5), 0.5)
CUSHION_STRIPES = Material(
    "cushion stripes", striped_fabric((linear("e8dcc0"), linear("a63d2f"), linear("2f4a5e"))), 0.4
)

# Garden
GRASS = Material("grass", grass(linear("b4cc6a"), linear("5c7c32")), 1.6)
LEAVES = Material("leaves", leaves(linear("a8c860"), linear("3f5f28")), 0.7, cutout=True)
DARK_LEAVES = Material("dark leaves", leaves(linear("86a860"), linear("2f4c26"), 240, 0.10), 0.6, cutout=True)
FERN = Material("fern", leaves(linear("9cc06a"), linear("3c5c2c"), 120, 0.2), 0.5, cutout=True)
ROSES = Material(
    "roses",
    blossoms((linear("e0485a"), linear("f4d0d4"), linear("c02840")), linear("7aa04c")),
    0.6,
    cutout=True,
)
DAISIES = Material(
    "daisies",
    blossoms((linear("f4f2ea"), linear("8a5ab0"), linear("e8b830")), linear("86a850")),
    0.6,
    cutout=True,
)
HEDGE = Material("hedge", thicket(linear("86ac54"), linear("45662e")), 0.9)
BARK = Material("bark", bark(linear("8a765c")), 0.6)
ROAD = Material("road", asphalt(linear("8a8a88")), 2.0)
SOIL = Material("soil", soil(linear("6e5440")), 1.0)
GRAVEL = Material("gravel", gravel((linear("d0c6b4"), linear("a89c8c"), linear("bcb0a0"))), 1.0)

# Print and small things
BOOKS = Material("books", book_spines(), 1.0, gloss=0.1)
PAGES = Material("pages", wood(linear("efe6d0"), linear("cfc3a6"), 30), 0.15)
PAPERS = Material("papers", papers(linear("b48a54")), 1.0)
LABEL = Material("label", label(linear("c8a068"), linear("a8332c")), 1.0)
CARTON = Material("carton", label(linear("b48c5c"), linear("8f6c42")), 1.0)
MILL = Material(
    "mill painting",
    framed(landscape_painting(linear("6f98c8"), linear("2c4424"), linear("f0dcb0")), linear("b08a44")),
    1.0,
)
DUSK = Material(
    "dusk painting",
    framed(landscape_painting(linear("3f4a78"), linear("2a2430"), linear("f0a060")), linear("3a2c22"), WHITE),
    1.0,
)
ABSTRACT = Material(
    "abstract painting",
    framed(
        abstract_painting(tuple(linear(c) for c in ["e8e0d0", "c04028", "204878", "e0b040", "2a2a2e"])),
        linear("2a2422"),
        WHITE,
    ),
    1.0,
)
SQUARES = Material(
    "squares painting",
    framed(
        abstract_painting(tuple(linear(c) for c in ["d8c8a8", "4f7f6a", "b86a3c", "e8dcc0", "6a3a4a"])),
        linear("c8a468"),
    ),
    1.0,
)
POSTER = Material(
    "poster", poster(linear("d86a34"), (linear("26406a"), linear("f0dfae"), linear("3a8a86"))), 1.0
)
SCREEN = Material("screen", screen(linear("2f6fa0"), linear("e8a050")), 1.0, gloss=0.9)
DIAL = Material("dial", dial_face(linear("f2ece0"), linear("26262a")), 1.0)
KEYBOARD = Material("keyboard", keyboard(), 1.0)
PEGBOARD = Material("pegboard", perforated(linear("b89468")), 0.5)
