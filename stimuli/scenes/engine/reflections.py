"""What is around smooth surfaces and metals: pictures of it from the middles of the rooms that they are in.

The pictures are blurred to grades of roughness as a GGX lobe blurs them at normal incidence (Karis 2013, Real
shading in Unreal Engine 4). They are drawn once, and stored in the user's cache.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenlight.stimuli.scenes.engine import graphics
from evenlight.stimuli.scenes.engine.antialiasing import NONE
from evenlight.stimuli.scenes.engine.array_cache import cached_array, scenes_sha256, store_array
from evenlight.stimuli.scenes.engine.camera import EYE_HEIGHT, EyeView
from evenlight.stimuli.scenes.engine.light.ray_tree import RayTree, ray_tree
from evenlight.stimuli.scenes.engine.light.seen_patches import met
from evenlight.stimuli.scenes.engine.material_textures import MaterialTextures
from evenlight.stimuli.scenes.engine.scene import Floats, Ground, Scene
from evenlight.stimuli.scenes.engine.vertices import faces_of

if TYPE_CHECKING:
    import moderngl

    from evenlight.stimuli.scenes.engine.renderer import GraphicsScene

SIDES = (256, 128, 64, 32, 16, 16)  # [texels] of each picture, from a mirror's to a rough surface's
RIM = 1  # [texels] around each
FIRST_ROW = np.cumsum([0, *(side + 2 * RIM for side in SIDES)])
TEXEL = 1 / (SIDES[0] + 2 * RIM), 1 / int(FIRST_ROW[-1])  # of the width and the height of all pictures
SHARPEST = 0.07  # roughness that a picture of one texel in 0.8 degrees shows
MOST_ROOMS, CANDIDATES = 16, 128
CELL = 1.5  # [m] candidates are about so far apart
TIGHT, MIDDLE = 0.3, 1.5  # [m] from a surface, from where its surroundings are seen: at least, at most
THICK = 0.05  # [m] that lies on a surface does not hide it
COVERED = 0.98  # of what is smooth, by area and gloss, is seen by the rooms' middles
UNEVEN = 0.3  # what has a relief counts like this, if it is not smoother
WALLS = 1  # grade of the lobe in which the walls of a room are sought
FARTHEST = 100.0  # [m] all beyond, and the sky, is taken to be this far away
# Right, up and forward of each of the six views.
VIEWS = np.array([
    np.roll([[0, -1, 0], [0, 0, 1], [1, 0, 0]], axis, axis=1) * [[sign], [1], [sign]]
    for axis in range(3) for sign in (1, -1)
], dtype=float)  # fmt: skip
WHOLE = (-1.0, 1.0, -1.0, 1.0)  # edges of a view of 90 by 90 degrees
Draw = Callable[[list[EyeView]], NDArray[np.float32]]


def shine_of(scene: Scene) -> Floats:
    """Return how smooth or metallic each patch is, (n,), or `UNEVEN`: 0 if it needs nothing around."""
    own = [max(m.gloss, m.metal, UNEVEN * (m.relief is not None)) for m in scene.materials]
    return np.array(own)[scene.patches.material]


def reflections(
    context: moderngl.Context, drawing: GraphicsScene,
    lit: tuple[Scene, MaterialTextures, NDArray[np.float16]], vertices: NDArray[np.void],
) -> tuple[moderngl.TextureArray, moderngl.Texture]:  # fmt: skip
    """Return the pictures around the rooms, and the rooms, as textures; the vertices are told their room.

    `lit` is the scene, the textures of its materials and the light on its surfaces.
    """

    def draw(views: list[EyeView]) -> NDArray[np.float32]:
        size, found = (SIDES[0], SIDES[0]), list[NDArray[np.float16]]()
        target = context.framebuffer(context.texture(size, 4, dtype="f2"), context.depth_renderbuffer(size))
        with graphics.own(context):
            for view in views:
                drawing.choose(view, size, NONE)
                target.use()
                target.clear()
                drawing.draw(view, size, np.eye(3))
                found.append(np.frombuffer(target.read(components=3, dtype="f2"), dtype=np.float16))
        return np.stack(found).reshape(-1, *size, 3).astype(np.float32)

    room, boxes, picture = surroundings(*lit, draw)
    vertices["normal"][:, 3] = np.repeat(room, 4)
    size = *picture.shape[2:0:-1], len(picture)
    around = context.texture_array(size, 3, picture.astype("f2"), dtype="f2", alignment=2)
    rooms = context.texture((3, len(boxes)), 3, boxes, dtype="f4")
    rooms.filter = graphics.NEAREST, graphics.NEAREST
    return around, rooms


def surroundings(
    scene: Scene, textures: MaterialTextures, light: NDArray[np.float16], draw: Draw
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return what a scene's smooth surfaces reflect: which room each patch is in, rooms and pictures.

    Rooms, (k, 3, 3): where each is seen from, its lower and its higher corner [m]. Pictures, (k, height,
    width, 3): in each one for each of `SIDES` over the other, row 0 at the bottom. `draw` draws views
    without reflections: their luminance, (v, side, side, 3), row 0 at the bottom.
    """
    patches, n = scene.patches, len(scene.patches)
    digest = hashlib.sha256(repr((scenes_sha256(), scene.sun, scene.sky)).encode())
    shine = [(material.gloss, material.metal) for material in scene.materials]
    for array in (patches.origin, patches.along, patches.across, patches.tint, np.array(shine), light,
                  *textures.codes, *(m.relief for m in scene.materials if m.relief is not None)):  # fmt: skip
        digest.update(np.ascontiguousarray(array).tobytes())
    name, width = f"reflections-{scene.name}-{digest.hexdigest()}", SIDES[0] + 2 * RIM
    stored = cached_array(name)
    if stored is None or stored.ndim != 1 or len(stored) < n:
        tree = ray_tree(patches, textures.coverage[patches.material])
        room, places = rooms_of(scene, tree)
        seen = draw([
            EyeView(*(*np.vstack([place, axes]).tolist(), WHOLE)) for place in places for axes in VIEWS
        ])  # fmt: skip
        seen = seen.reshape(len(places), len(VIEWS), SIDES[0], SIDES[0], 3)
        parts = room, np.array([box_around(tree, place) for place in places]), blurred(seen)
        stored = np.concatenate([np.ravel(part) for part in parts]).astype(np.float32)
        store_array(name, stored, instead_of=f"reflections-{scene.name}-*")
    size = int(FIRST_ROW[-1]), width, 3
    count = (len(stored) - n) // (9 + math.prod(size))
    room, boxes, pictures = np.split(stored, [n, n + 9 * count])
    return room, boxes.reshape(count, 3, 3), pictures.reshape(count, *size)


def rooms_of(scene: Scene, tree: RayTree) -> tuple[NDArray[np.int64], Floats]:
    """Return which room each patch is in, (n,), and from where the rooms are seen, (k, 3) [m].

    Of places over the ground that one walks on (or half-way between smooth surfaces and what is across from
    them) as few are taken as see nearly all that can be seen; a patch belongs to the nearest that sees it.
    """
    patches, shine = scene.patches, shine_of(scene)
    faces = faces_of(patches)
    area = np.linalg.norm(np.cross(patches.along, patches.across), axis=1) / (1 + patches.triangle)
    shiny = np.flatnonzero(shine > 0)
    share = (patches.triangle[shiny, None] / -6) + 0.5
    middle = patches.origin[shiny] + share * (patches.along + patches.across)[shiny]
    normal, weight = faces.planes[shiny, :3], (area * shine)[shiny]
    heaviest = np.argsort(-weight, kind="stable")
    places = over_the_ground(scene)
    if not len(places):
        across = np.minimum(met(tree, middle + 0.01 * normal, normal)[1] / 2, MIDDLE)[heaviest]
        places = (middle[heaviest] + across[:, None] * normal[heaviest])[across >= min(TIGHT, across.max())]
    _, first = np.unique(np.rint(places / CELL), axis=0, return_index=True)
    places = places[np.sort(first)[:CANDIDATES]]
    large = heaviest[: 64 * CANDIDATES]

    def seen(place: Floats, which: NDArray[np.int64]) -> NDArray[np.bool_]:
        ahead = ((place - middle[which]) * normal[which]).sum(axis=1) > 0
        rays = middle[which] - place
        short = (1 - met(tree, np.tile(place, (len(which), 1)), rays)[1]) * np.linalg.norm(rays, axis=1)
        return np.asarray(ahead & (short < THICK))

    sees = np.array([seen(place, large) for place in places])
    left, chosen = weight[large].copy(), list[int]()
    while len(chosen) < MOST_ROOMS and (not chosen or left.sum() > (1 - COVERED) * weight[large].sum()):
        best = int(np.argmax(sees @ left))
        if chosen and not sees[best] @ left:
            break
        chosen.append(best)
        left[sees[best]] = 0
    everywhere = np.arange(len(shiny))
    away = [
        np.linalg.norm(middle - place, axis=1) + np.where(seen(place, everywhere), 0, FARTHEST)
        for place in places[chosen]
    ]
    room = np.zeros(len(patches), dtype=np.int64)
    room[shiny] = np.argmin(away, axis=0)
    return room, places[chosen]


def box_around(tree: RayTree, place: Floats) -> Floats:
    """Return a place, and the lower and the higher corner of the box that is around it, (3, 3) [m].

    In each of the six directions the mean nearness counts of what is met: a door does not open a room.
    """
    ahead = VIEWS[:, 2]
    rays = spread(ahead, WALLS)
    away = met(tree, np.tile(place, (rays.size // 3, 1)), rays.reshape(-1, 3))[1].reshape(rays.shape[:2])
    away = np.clip(away, 0.01, FARTHEST) * (rays * ahead).sum(axis=2)
    walls = (ahead / (1 / away).mean(axis=0)[:, None]).reshape(3, 2, 3).sum(axis=0)
    return np.array([place, place + walls[1], place + walls[0]])


def over_the_ground(scene: Scene) -> Floats:
    """Return places at the height of the eye, (m, 3), a `CELL` apart on all that one may walk on."""
    places = [
        (x, y, ground.height(x, y) + EYE_HEIGHT)
        for ground in scene.walkable
        if isinstance(ground, Ground)
        for x in _spread(ground.low[0], ground.high[0])
        for y in _spread(ground.low[1], ground.high[1])
    ]
    return np.array(places).reshape(-1, 3)


def _spread(low: float, high: float) -> list[float]:
    count = max(round((high - low) / CELL), 1)
    return [low + (k + 0.5) / count * (high - low) for k in range(count)]


def octahedron(side: int, rim: int = 0) -> Floats:
    """Return the directions of the texels of a picture that lays an octahedron flat, (side, side, 3).

    Beyond its edges it goes on with what is there on the octahedron.
    """
    at = (np.arange(-rim, side + rim) + 0.5) / side * 2 - 1
    y, x = np.meshgrid(at, at, indexing="ij")
    for _ in range(2):  # once for each edge that is left behind
        beyond, above = np.abs(x) > 1, np.abs(y) > 1
        x, y = (
            np.where(beyond, np.sign(x) * 2 - x, np.where(above, -x, x)),
            np.where(beyond, -y, np.where(above, np.sign(y) * 2 - y, y)),
        )
    z = 1 - np.abs(x) - np.abs(y)
    turned = (1 - np.abs(y)) * np.where(x < 0, -1, 1), (1 - np.abs(x)) * np.where(y < 0, -1, 1)
    found = np.stack([np.where(z < 0, turned[0], x), np.where(z < 0, turned[1], y), z], axis=-1)
    return np.asarray(found / np.linalg.norm(found, axis=-1, keepdims=True))


def lobe(grade: int) -> Floats:
    """Return directions around (0, 0, 1) that are alike in number to what a grade reflects, (m, 3)."""
    count = 8 if grade == 0 else 64
    narrow = max(grade / (len(SIDES) - 1), SHARPEST) ** 2
    share, turn = (np.arange(count) + 0.5) / count, np.arange(count) * np.pi * (3 - np.sqrt(5))
    squared = (1 - share) / (1 + (narrow**2 - 1) * share)  # cosine of the half vector
    sine = 2 * np.sqrt(squared * (1 - squared))
    return np.column_stack([sine * np.cos(turn), sine * np.sin(turn), 2 * squared - 1])


def spread(middle: Floats, grade: int) -> Floats:
    """Return the directions of a grade's lobe around some directions, (m, ..., 3)."""
    other = np.where(np.abs(middle[..., 2:]) < 0.7, [0.0, 0, 1], [1.0, 0, 0])
    right = np.cross(other, middle)
    right /= np.linalg.norm(right, axis=-1, keepdims=True)
    frame = np.stack([right, np.cross(middle, right), middle], axis=-1)
    return np.stack([frame @ ray for ray in lobe(grade)])


def lobes_of(gloss: ArrayLike) -> Floats:
    """Return what the shader knows of the lobes of materials, (m, 4), from how smooth they are, (m, 1).

    Of the picture, the middle row and half the width [texels]; of what spreads the sun's light, two factors.
    """
    rough = 1 - np.ravel(gloss)
    grade = (rough * (len(SIDES) - 1) + 0.5 + 1e-6).astype(int)  # such as of 0.7 alike on all machines
    squared, half = np.maximum(rough**2, 0.02) ** 2, np.array(SIDES)[grade] / 2
    cosine = np.array([lobe(k)[:, 2].clip(0).mean() for k in grade])  # nothing counts below the surface
    return np.column_stack([FIRST_ROW[grade] + RIM + half, half, 1 - squared, squared / (4 * cosine)])


def blurred(seen: NDArray[Any]) -> NDArray[np.float32]:
    """Return the pictures of rooms, (k, height, width, 3), from what was drawn, (k, 6, side, side, 3)."""
    pictures = np.zeros((len(seen), int(FIRST_ROW[-1]), SIDES[0] + 2 * RIM, 3), dtype=np.float32)
    for grade, (side, first) in enumerate(zip(SIDES, FIRST_ROW, strict=False)):
        sums, cosines = np.zeros((len(seen), side + 2 * RIM, side + 2 * RIM, 3)), lobe(grade)[:, 2].clip(0)
        for rays, cosine in zip(spread(octahedron(side, RIM), grade), cosines, strict=True):
            sums += cosine * looked_up(seen, rays)
        pictures[:, first : first + side + 2 * RIM, : side + 2 * RIM] = sums / cosines.sum()
        if grade and seen.shape[2] > SIDES[-1]:
            seen = (seen[:, :, ::2] + seen[:, :, 1::2]) / 2
            seen = (seen[:, :, :, ::2] + seen[:, :, :, 1::2]) / 2
    return pictures


def looked_up(seen: NDArray[Any], rays: Floats) -> NDArray[np.float32]:
    """Return what is seen in directions, (k, ..., 3), in pictures of each room's six views."""
    view = np.argmax(rays @ VIEWS[:, 2].T, axis=-1)
    right, up, ahead = np.moveaxis((VIEWS[view] @ rays[..., None])[..., 0], -1, 0)
    side = seen.shape[2]
    column, row = (np.clip(((at / ahead + 1) / 2 * side).astype(int), 0, side - 1) for at in (right, up))
    return np.asarray(seen[:, view, row, column])
