"""The textures that both scenes share, gathered: each function returns a texture for given colours.

A texture is called with a generator and a size and gives linear albedo, (size, size, 3) in [0, 1], whose
opposite edges meet; `leaves` and `blossoms` give a fourth channel, the share of the pixel that is covered.
Row 0 is the top of what stands upright (v = 1 if v is counted from below).
"""

from __future__ import annotations

from evenlight.stimuli.scenes.colours import Colour, Texture, linear
from evenlight.stimuli.scenes.textures_cloth import (
    carpet,
    checked_fabric,
    curtain,
    fabric,
    rug,
    striped_fabric,
)
from evenlight.stimuli.scenes.textures_garden import bark, blossoms, grass, gravel, leaves, soil, thicket
from evenlight.stimuli.scenes.textures_print import (
    SHELVES,
    SPINES,
    abstract_painting,
    book_spines,
    framed,
    label,
    landscape_painting,
    papers,
    poster,
    spine_cell,
    written,
)
from evenlight.stimuli.scenes.textures_things import dial_face, keyboard, perforated, screen, wire
from evenlight.stimuli.scenes.textures_walls import (
    asphalt,
    brick,
    chequered_tiles,
    concrete,
    metal,
    painted_brick,
    paving,
    plaster,
    roof_tiles,
    stripes,
    terrazzo,
    tiles,
)
from evenlight.stimuli.scenes.textures_wood import painted_boards, panel_door, planks, wood

__all__ = [
    "SHELVES",
    "SPINES",
    "Colour",
    "Texture",
    "abstract_painting",
    "asphalt",
    "bark",
    "blossoms",
    "book_spines",
    "brick",
    "carpet",
    "checked_fabric",
    "chequered_tiles",
    "concrete",
    "curtain",
    "dial_face",
    "fabric",
    "framed",
    "grass",
    "gravel",
    "keyboard",
    "label",
    "landscape_painting",
    "leaves",
    "linear",
    "metal",
    "painted_boards",
    "painted_brick",
    "panel_door",
    "papers",
    "paving",
    "perforated",
    "planks",
    "plaster",
    "poster",
    "roof_tiles",
    "rug",
    "screen",
    "soil",
    "spine_cell",
    "striped_fabric",
    "stripes",
    "terrazzo",
    "thicket",
    "tiles",
    "wire",
    "wood",
    "written",
]
