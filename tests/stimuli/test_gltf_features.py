"""What many glTF files have is drawn as in the file; what is not is listed, with its share of the view."""

import json
import math
from collections.abc import Iterator
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import moderngl
import numpy as np
import pytest
from gltf_files import CORNERS, FLOOR, LAMP, SQUARE, Glb, image_bytes, room
from PIL import Image
from typer.testing import CliRunner

from evenlight.command import app
from evenlight.data_schema.errors import InputError
from evenlight.stimuli.scenes.engine.antialiasing import OFFLINE
from evenlight.stimuli.scenes.engine.camera import Camera
from evenlight.stimuli.scenes.engine.camera_path import CameraPath, Keypoint
from evenlight.stimuli.scenes.engine.graphics import offscreen_context
from evenlight.stimuli.scenes.engine.light.bake import baked, charts_of, texels_of
from evenlight.stimuli.scenes.engine.material_textures import material_textures
from evenlight.stimuli.scenes.engine.model import SceneModel
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer
from evenlight.stimuli.scenes.engine.scene import Material, Quality, Scene, Sky, Sun
from evenlight.stimuli.scenes.gltf import texture_memory
from evenlight.stimuli.scenes.gltf.gltf_differences import words_of_differences
from evenlight.stimuli.scenes.gltf.gltf_export import glb_of
from evenlight.stimuli.scenes.gltf.gltf_file import read_gltf
from evenlight.stimuli.scenes.gltf.gltf_scene import scene_from_gltf
from evenlight.stimuli.scenes.gltf.texture_memory import with_images_that_fit

pytest.importorskip("trimesh")
DOWN = Camera((0.0, 0.0, 1.0), 0.0, -90.0, field_of_view=90.0)  # 2 m of the floor, north is up
ABOVE = 24.0  # [cd/m^2] of white paper that faces up, in light that is guessed


@pytest.fixture
def context() -> Iterator[moderngl.Context]:
    with offscreen_context() as context:
        yield context


def read(folder: Path, glb: Glb) -> Scene:
    file = folder / "room.glb"
    file.write_bytes(glb.content())
    return scene_from_gltf(read_gltf(file))


def seen(context: moderngl.Context, scene: Scene, size: int = 16) -> np.ndarray:
    renderer = SceneRenderer(context, scene, (size, size), None, OFFLINE)
    renderer.render(DOWN)
    return renderer.luminance()


def matt_room(colour: tuple[float, ...] = (1, 1, 1, 1)) -> Glb:
    """The room with a matt floor of one colour."""
    glb, paint = room(), {"metallicFactor": 0, "baseColorFactor": list(colour)}
    glb.header["materials"][FLOOR] = {"pbrMetallicRoughness": paint}
    return glb


def two_coloured() -> bytes:
    """White on the left, black on the right."""
    return image_bytes(np.repeat(np.array([[[255] * 3] * 2 + [[0] * 3] * 2], np.uint8), 4, axis=0))


def above(glb: Glb, height: float, side: float, material: dict) -> None:
    """Lay a square of a material of its own over the floor [m]."""
    glb.header["materials"].append(material)
    (floor,) = glb.header["meshes"][FLOOR]["primitives"]
    glb.header["meshes"].append({"primitives": [floor | {"material": len(glb.header["materials"]) - 1}]})
    node = {"mesh": len(glb.header["meshes"]) - 1, "translation": [0, height, 0], "scale": [side / 2] * 3}
    glb.header["nodes"].append(node)
    glb.header["scenes"][0]["nodes"].append(len(glb.header["nodes"]) - 1)


def test_a_texture_is_moved_turned_and_scaled_as_the_extension_says(tmp_path):
    """Scaled by (2, 1), turned by 90 degrees: (u, v) to (v, -2u), v down; moved by (0.25, 0.5)."""
    glb = room()
    glb.add_texture(FLOOR, two_coloured())
    moved = {"offset": [0.25, 0.5], "rotation": math.pi / 2, "scale": [2, 1]}
    texture = glb.header["materials"][FLOOR]["pbrMetallicRoughness"]["baseColorTexture"]
    before = read(tmp_path, glb).patches.uvs[0]
    texture["extensions"] = {"KHR_texture_transform": moved}
    after = read(tmp_path, glb).patches.uvs[0]
    u, down = before[:, 0], 1 - before[:, 1]
    np.testing.assert_allclose(after, np.column_stack([down + 0.25, 1 - (0.5 - 2 * u)]), atol=1e-9)


@pytest.mark.parametrize(
    ("wrap", "bright"),
    [
        (10497, [1, 0, 1, 0, 1, 0]),  # repeated
        (33648, [0, 1, 1, 0, 0, 1]),  # mirrored: what is between 0 and 1 is in the middle
        (33071, [1, 1, 1, 0, 0, 0]),  # clamped to the edge
    ],
)
def test_textures_repeat_are_mirrored_or_end_at_their_edges(tmp_path, context, wrap, bright):
    """The texture, white and black, three times over the floor's middle: from -1 to 2 along u."""
    glb = matt_room()
    glb.add_texture(FLOOR, two_coloured())
    glb.header["samplers"] = [{"wrapS": wrap, "magFilter": 9728}]
    glb.header["textures"][0]["sampler"] = 0
    texture = glb.header["materials"][FLOOR]["pbrMetallicRoughness"]["baseColorTexture"]
    # The floor is 4 m wide, and 2 m of it are seen: from 0.25 to 0.75.
    texture["extensions"] = {"KHR_texture_transform": {"scale": [6, 1], "offset": [-2.5, 0]}}
    picture = seen(context, read(tmp_path, glb), size=24)[12, :, 0].reshape(6, 4)
    np.testing.assert_allclose(picture[:, 1:3].mean(axis=1), ABOVE * np.array(bright), atol=0.2)


def test_colours_of_points_change_evenly_between_them(tmp_path, context):
    """Black in the west and white in the east of 4 m: 1/4 to 3/4 of white over the 2 m that are seen."""
    glb = matt_room()
    colours = np.array([[0, 0, 0], [1, 1, 1], [1, 1, 1], [0, 0, 0]], "<f4")
    (floor,) = glb.header["meshes"][FLOOR]["primitives"]
    floor["attributes"]["COLOR_0"] = glb.add_array(colours, "VEC3", 5126)
    expected = ABOVE * (0.25 + 0.5 * (np.arange(16) + 0.5) / 16)
    np.testing.assert_allclose(seen(context, read(tmp_path, glb))[:, :, 0], [expected] * 16, rtol=0.01)


@pytest.mark.parametrize("indexed", [True, False])
@pytest.mark.parametrize(("mode", "order"), [(5, [0, 1, 3, 2]), (6, [0, 1, 2, 3])])
def test_fans_and_strips_are_the_same_floor(tmp_path, mode, order, indexed):
    glb = room()
    (floor,) = glb.header["meshes"][FLOOR]["primitives"]
    del floor["indices"]
    floor["mode"] = mode
    corners = np.array([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], "<f4")
    if indexed:
        floor["indices"] = glb.add_array(np.array(order, "<u2"), "SCALAR", 5123)
    else:
        floor["attributes"] = {"POSITION": glb.add_array(corners[order], "VEC3", 5126)}
    patches = read(tmp_path, glb).patches
    facing = np.cross(patches.along, patches.across)[:-1]
    assert (facing * np.where(patches.triangle[:-1], 0.5, 1)[:, None]).sum(axis=0) == pytest.approx(
        [0, 0, 16]
    )


@pytest.mark.parametrize(("kind", "component", "shares"), [("<i2", 5122, True), ("i1", 5120, False)])
def test_whole_numbers_of_a_quantized_mesh_are_what_they_stand_for(tmp_path, kind, component, shares):
    """Four bytes or eight a point, as KHR_mesh_quantization asks; the node halves what is meant as it is."""
    one = np.iinfo(kind).max if shares else 2
    glb = matt_room()
    floor = glb.header["meshes"][FLOOR]["primitives"][0]["attributes"]
    for name, values in (("POSITION", SQUARE), ("NORMAL", SQUARE * 0 + [0, 1, 0]), ("TEXCOORD_0", CORNERS)):
        largest = np.iinfo(kind).max if name == "NORMAL" else one
        padded = np.zeros((4, 4), kind)
        padded[:, : values.shape[1]] = np.rint(values * largest)
        floor[name] = glb.add_array(padded, f"VEC{values.shape[1]}", component)
        accessor = glb.header["accessors"][floor[name]]
        accessor["normalized"] = shares or name == "NORMAL"
        glb.header["bufferViews"][accessor["bufferView"]]["byteStride"] = padded.strides[0]
    glb.header["nodes"][FLOOR]["scale"] = [2, 1, 2] if shares else [1, 1, 1]
    glb.header["extensionsRequired"] = ["KHR_mesh_quantization"]
    expected, patches = read(tmp_path, matt_room()).patches, read(tmp_path, glb).patches
    np.testing.assert_allclose(patches.origin, expected.origin, atol=1e-3)
    np.testing.assert_allclose(patches.along, expected.along, atol=1e-3)
    np.testing.assert_allclose(patches.normals, expected.normals, atol=1e-3)
    uvs = expected.uvs if shares else (expected.uvs - [0, 1]) * 2 + [0, 1]
    np.testing.assert_allclose(patches.uvs[0], uvs[0], atol=1e-3)


def test_specular_glossiness_is_its_diffuse_colour_less_what_is_reflected(tmp_path):
    glb = room()
    shiny = {"diffuseFactor": [0.8, 0.4, 0.2, 1], "specularFactor": [0, 0.5, 0.1], "glossinessFactor": 0.3}
    glb.header["scenes"][0]["nodes"] = [FLOOR]
    glb.header["materials"][FLOOR] = {"extensions": {"KHR_materials_pbrSpecularGlossiness": shiny}}
    scene = read(tmp_path, glb)
    np.testing.assert_allclose(scene.patches.tint[0], [0.4, 0.2, 0.1])
    assert scene.materials[scene.patches.material[0]].gloss == 0.3
    assert [one.feature for one in scene.unlike] == ["specular colour (reflects as plastics do)"]


def test_gloss_and_metal_go_out_and_come_back(tmp_path):
    model, file = SceneModel("plates", 1), tmp_path / "plates.glb"
    kinds = {"steel": (0.7, 1.0), "glass": (1.0, 0.0), "felt": (0.0, 0.0)}
    for k, (name, shine) in enumerate(kinds.items()):
        paper = Material(name, lambda rng, size: np.full((size, size, 3), 0.5, "f4"), 1.0, *shine)
        model.quad([[k, 0, 0], [k + 1, 0, 0], [k + 1, 1, 0], [k, 1, 0]], paper)
    file.write_bytes(glb_of(model.build()))
    scene = scene_from_gltf(read_gltf(file))
    order = scene.patches.material[np.argsort(scene.patches.origin[:, 0])]
    assert [(scene.materials[k].gloss, scene.materials[k].metal) for k in order] == [*kinds.values()]
    assert not scene.unlike


def test_metal_and_roughness_of_a_texture_are_their_means(tmp_path):
    """Half of the texture has (roughness, metal) of (1, 1), half of (0.2, 0), in green and blue."""
    glb = room()
    glb.add_texture(FLOOR, image_bytes(np.array([[[0, 255, 255], [0, 51, 0]]] * 2, np.uint8)))
    paint = glb.header["materials"][FLOOR]["pbrMetallicRoughness"]
    paint |= {"metallicFactor": 0.8, "metallicRoughnessTexture": paint.pop("baseColorTexture")}
    scene = read(tmp_path, glb)
    material = scene.materials[scene.patches.material[0]]
    assert (material.gloss, material.metal) == (0.4, 0.4)
    assert scene.unlike[0].feature == "metal and roughness of a texture (their means)"


def test_an_image_in_webp_is_read_before_the_one_for_others(tmp_path):
    glb = room()
    glb.add_texture(FLOOR, b"of a kind that is not read")
    out = BytesIO()
    Image.new("RGB", (8, 8), (188, 188, 188)).save(out, format="WEBP", lossless=True)
    glb.header["images"].append({"bufferView": glb.add_view(out.getvalue()), "mimeType": "image/webp"})
    glb.header["textures"][0]["extensions"] = {"EXT_texture_webp": {"source": 1}}
    glb.header["extensionsRequired"] = ["EXT_texture_webp"]
    scene = read(tmp_path, glb)
    albedo = material_textures(scene).albedo[scene.patches.material[0]]
    np.testing.assert_allclose(albedo, 0.503, atol=0.004)  # of code 188 (IEC 61966-2-1)


@pytest.mark.parametrize(
    ("u", "down", "towards"),  # coordinates at the corners, and where u and v of the picture grow
    [
        ([0, 1, 1, 0], [1, 1, 0, 0], [[1, 0], [0, 1]]),
        ([1, 0, 0, 1], [1, 1, 0, 0], [[-1, 0], [0, 1]]),  # mirrored
        ([0, 1, 1, 0], [0, 0, 1, 1], [[1, 0], [0, -1]]),  # mirrored the other way
        ([1, 1, 0, 0], [0, 5, 5, 0], [[0, -1], [-1, 0]]),  # turned, and denser along v
    ],
)
@pytest.mark.parametrize("leaning", [[0.5, 0], [0, 0.5], [-0.3, 0.4]])
@pytest.mark.parametrize("scale", [1, 2])
def test_a_normal_map_turns_the_sun_s_light(tmp_path, context, u, down, towards, leaning, scale):
    """By 30 degrees: white paper has the sun's light by the cosine (Lambert), within 3 codes of 8 bits."""
    upright = math.sqrt(0.75)
    stored = np.array([*leaning, upright * scale]) / math.hypot(0.5, upright * scale)
    glb, (x, y) = matt_room(), leaning @ np.array(towards)
    coordinates = np.column_stack([u, down]).astype("<f4")
    glb.header["meshes"][FLOOR]["primitives"][0]["attributes"]["TEXCOORD_0"] = glb.add_array(
        coordinates, "VEC2", 5126
    )
    glb.add_texture(FLOOR, image_bytes(np.full((4, 8, 3), np.rint((stored + 1) * 127.5), np.uint8)))
    del glb.header["materials"][FLOOR]["pbrMetallicRoughness"]["baseColorTexture"]
    glb.header["materials"][FLOOR]["normalTexture"] = {"index": 0, "scale": scale}
    glb.header["scenes"][0]["nodes"] = [FLOOR]
    sun = Sun(60.0, 40.0, 200.0)
    scene = replace(read(tmp_path, glb), sun=sun)
    assert not scene.unlike
    renderer = SceneRenderer(context, scene, (16, 16), Quality.COARSE, OFFLINE)
    renderer.render(DOWN)
    expected = sun.luminance() * max(sun.direction() @ [x, y, upright], 0)
    np.testing.assert_allclose(renderer.luminance(), np.tile(expected, (16, 16, 1)), atol=3 / 255 * 64)


def test_a_surface_that_is_half_there_shows_half_of_what_is_behind(tmp_path, context):
    """Red of 0.8 and an opacity of 0.25 over white: 1 - 0.25 + 0.25 x 0.8 in red, 0.75 else; two of them."""
    glb = matt_room()
    paint = {"baseColorFactor": [0.8, 0, 0, 0.25], "metallicFactor": 0}
    half = {"alphaMode": "BLEND", "pbrMetallicRoughness": paint}
    above(glb, 0.1, 4, half)
    np.testing.assert_allclose(
        seen(context, read(tmp_path, glb))[8, 8], ABOVE * np.array([0.95, 0.75, 0.75]), rtol=0.01
    )
    green = {"alphaMode": "BLEND", "pbrMetallicRoughness": paint | {"baseColorFactor": [0, 1, 0, 0.5]}}
    above(glb, 0.05, 4, green)  # seen through the first, although it comes after it
    above(glb, 0.2, 4, {"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}}})  # clear
    twice = seen(context, read(tmp_path, glb))[8, 8]
    np.testing.assert_allclose(twice, ABOVE * np.array([0.575, 0.75, 0.375]), rtol=0.01)


def test_the_light_of_an_emissive_texture_is_laid_over_the_base_colour(tmp_path, context):
    """30 cd/m^2 on the left half, over a grey of 0.5; only what shines lights the room."""
    glb = matt_room((0.5, 0.5, 0.5, 1))
    glb.header["images"] = [{"bufferView": glb.add_view(two_coloured())}]
    glb.header["textures"] = [{"source": 0, "sampler": 0}]
    strength = {"KHR_materials_emissive_strength": {"emissiveStrength": 30.0}}
    grey = glb.header["materials"][FLOOR]
    grey |= {"emissiveTexture": {"index": 0}, "emissiveFactor": [1, 1, 0], "extensions": strength}
    glb.header["samplers"] = [{"magFilter": 9728}]
    scene = read(tmp_path, glb)
    picture = seen(context, scene)[8]
    np.testing.assert_allclose(picture[4], [ABOVE / 2 + 30, ABOVE / 2 + 30, ABOVE / 2], rtol=0.01)
    np.testing.assert_allclose(picture[12], ABOVE / 2, rtol=0.01)
    shining = scene.patches.emission[scene.patches.emission.any(axis=1)]
    np.testing.assert_allclose(shining[0], [15, 15, 0], rtol=0.02)  # its mean


def test_lights_of_the_file_light_it(tmp_path):
    """90 cd from 2 m above give 22.5 lx, white paper 22.5 / pi cd/m^2 below (inverse square; Lambert)."""
    glb = matt_room()
    del glb.header["materials"][LAMP]["emissiveFactor"]
    lights = [
        {"type": "point", "color": [1, 1, 0.5], "intensity": 90.0},
        {"type": "directional", "intensity": 500},
    ]
    glb.header["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
    turned = [-math.sin(math.pi / 12), 0, 0, math.cos(math.pi / 12)]  # 30 degrees down from the north
    for k, place in enumerate(({"translation": [0, 2, 0]}, {"rotation": turned})):
        glb.header["nodes"].append(place | {"extensions": {"KHR_lights_punctual": {"light": k}}})
        glb.header["scenes"][0]["nodes"].append(2 + k)
    glb.header["scenes"][0]["nodes"].remove(1)  # the lamp of the room
    scene = read(tmp_path, glb)
    assert scene.sun.illuminance == pytest.approx(500)
    np.testing.assert_allclose(scene.sun.direction(), [0, -math.sqrt(0.75), 0.5], atol=1e-6)
    charts, textures = charts_of(scene.patches, scene.holed()), material_textures(scene)
    light = baked(replace(scene, sun=None), charts, (textures.albedo, textures.coverage), Quality.COARSE)
    at = texels_of(scene.patches, charts)
    floor = at.patch == len(scene.patches) - 1
    far = 1 + (2 * np.hypot(at.s[floor] - 0.5, at.t[floor] - 0.5)) ** 2  # (distance / 2 m)^2
    paper = 22.5 / math.pi * (far**-1.5).mean() * np.array([1, 1, 0.5])  # of all: nearby, light is mixed
    np.testing.assert_allclose(light[floor].mean(axis=0), paper, rtol=0.03)


def test_no_light_is_brighter_than_what_is_stored(tmp_path):
    """Blender's lamp of 1000 W goes out as 54 351 cd; a quarter of a ball's surface is seen (Cauchy)."""
    glb = matt_room()
    lights = [{"type": "point", "intensity": 54351.0}]
    glb.header["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
    glb.header["nodes"].append({"extensions": {"KHR_lights_punctual": {"light": 0}}})
    glb.header["scenes"][0]["nodes"].append(2)
    strength = {"KHR_materials_emissive_strength": {"emissiveStrength": 1e6}}
    glb.header["materials"][LAMP] |= {"emissiveFactor": [1, 1, 1], "extensions": strength}
    scene = read(tmp_path, glb)
    assert np.isfinite(scene.patches.emission.astype(np.float16)).all()
    ball = scene.patches.emission[:, 0] * (scene.patches.material == 0) / 4
    area = np.linalg.norm(np.cross(scene.patches.along, scene.patches.across), axis=1) / 2
    assert (ball * area).sum() == pytest.approx(54351, rel=1e-3)
    assert "a lamp brighter than 60000 cd/m² (no brighter)" in {one.feature for one in scene.unlike}


def straight_down(height: float) -> CameraPath:
    points = [Keypoint(name, time, (0.0, 0.0, height), 0.0, -90.0) for name, time in (("a", 0.0), ("b", 1.0))]
    return CameraPath("down", "room.glb", 1.0, tuple(points))


def test_what_is_not_as_in_the_file_is_listed_once_with_its_share_of_the_view(tmp_path):
    """From 4 m, 8 x 4.5 m are seen; the floor is 4 x 4 m, and the lamp over it is not seen from behind."""
    glb = room()
    glb.add_texture(FLOOR, two_coloured())
    relief = {"index": 0, "texCoord": 1}
    glb.header["materials"][FLOOR] |= {"name": "tiles", "normalTexture": relief, "alphaMode": "MASK"}
    glb.header["meshes"][FLOOR] |= {"name": "floor"}
    glb.header["nodes"].append(glb.header["nodes"][0] | {"translation": [0, -1, 0]})  # below, hidden
    glb.header["scenes"][0]["nodes"].append(2)
    glb.header["animations"] = [{"channels": [{"target": {"node": 0, "path": "rotation"}}]}]
    lines = words_of_differences(read(tmp_path, glb), straight_down(4.0), 90.0)
    shares = [float(line.partition("%")[0]) for line in lines]
    assert shares == pytest.approx([100 * 16 / 36] * 3 + [0], abs=1)
    assert [line.partition("view: ")[2] for line in lines] == [
        "animation (stands still): floor",
        "holes in one side (seen from both): tiles on floor",
        "normal map that lies unlike the colour (drawn smooth): tiles on floor",
        "base colour of a lamp (only its light): material 1 on mesh 1",
    ]


def test_nothing_is_listed_of_what_a_file_declares_and_does_not_use(tmp_path):
    glb = matt_room()
    glb.header["materials"][LAMP]["emissiveFactor"] = [1, 1, 1]
    names = ["KHR_texture_transform", "KHR_lights_punctual", "KHR_materials_clearcoat", "EXT_of_the_future"]
    glb.header["extensionsUsed"] = names
    assert read(tmp_path, glb).unlike == ()
    glb.header["extensionsRequired"] = names
    with pytest.raises(InputError, match="it needs EXT_of_the_future, which is not read"):
        read(tmp_path, glb)


def test_a_film_of_a_file_tells_what_is_not_as_in_it_or_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    glb = room()
    glb.header["materials"][FLOOR]["occlusionTexture"] = {}
    Path("room.glb").write_bytes(glb.content())
    down = {"position_m": [0, 0, 2], "azimuth_deg": 0, "altitude_deg": -90}
    keypoints = [{"name": name, "time_s": time} | down for name, time in (("a", 0), ("b", 1))]
    Path("walk.json").write_text(json.dumps({"duration_s": 1.0, "keypoints": keypoints}))
    options = ["render", "room.glb", "--path", "walk.json", "--size", "32x18", "--fps", "2", "--out", "a.mkv"]
    with pytest.raises(
        InputError, match=r"room.glb: not shown as in the file: occlusion .*; leave out --strict"
    ):
        CliRunner().invoke(app, [*options, "--strict"], catch_exceptions=False)
    said = CliRunner().invoke(app, options, catch_exceptions=False).output
    assert "of the view: occlusion map (light is computed): material 0 on mesh 0" in said


def test_images_beyond_the_memory_are_made_smaller_where_it_is_seen_least(tmp_path, monkeypatch):
    """Two images of 256 x 256: that which is laid over 0.4 m is seen ten times as fine as that over 4 m."""
    monkeypatch.setattr(texture_memory, "MOST_TEXELS", 100_000)
    glb = matt_room()
    glb.add_texture(FLOOR, image_bytes(np.full((256, 256, 3), 200, np.uint8)))
    view = glb.add_view(image_bytes(np.full((256, 256, 3), 90, np.uint8)))
    glb.header["images"].append({"bufferView": view, "name": "label.png"})
    glb.header["textures"].append({"source": 1})
    label = {"baseColorTexture": {"index": 1}, "metallicFactor": 0}
    above(glb, 0.1, 0.4, {"pbrMetallicRoughness": label})
    scene = with_images_that_fit(read(tmp_path, glb), straight_down(2.0))
    assert sorted(m.sampling.size for m in scene.materials if m.sampling) == [(1, 1), (128, 128), (256, 256)]
    said = [one for one in scene.unlike if "made smaller" in one.feature]
    assert [one.where for one in said] == ["label.png"]
    # 128 texels over 0.4 m, seen from 1.9 m less half a diagonal.
    finest = 128 / 0.4 * (1.9 - 0.2 * math.sqrt(2)) * math.pi / 180
    assert f"256x256 made smaller, 128x128, to fit into memory ({finest:.3g} texels/°)" in said[0].feature


CYCLES, TEXELS = 32, 2048  # of a grating over a texture


@pytest.mark.parametrize("turned", [0, 60, 75])  # [deg]: how obliquely the wall is seen
@pytest.mark.parametrize("upright", [True, False])
def test_contrast_is_within_2_percent_up_to_the_displays_nyquist_frequency(
    tmp_path, context, turned, upright
):
    """Against the formula's mean over each pixel; interpolation of texels, as in the file, leaves sinc^2."""
    shares = 0.4 + 0.3 * np.cos(2 * math.pi * CYCLES * (np.arange(TEXELS) + 0.5) / TEXELS)
    codes = np.rint(255 * (1.055 * shares ** (1 / 2.4) - 0.055)).astype(np.uint8)
    picture = np.tile(codes, (TEXELS, 1))
    glb = matt_room()
    glb.add_texture(FLOOR, image_bytes(picture if upright else picture.T.copy()))
    glb.header["scenes"][0]["nodes"] = [0]  # the floor alone, 4 m, over which the camera leans
    scene = replace(read(tmp_path, glb), sky=Sky((50.0,) * 3, (50.0,) * 3))
    renderer = SceneRenderer(context, scene, (96, 64), Quality.FINE, OFFLINE)
    lean = math.radians(turned)
    eye = (-2.0 * math.sin(lean), 0.0, 2.0 * math.cos(lean))
    for cycles in (0.25, 0.4, 0.49):  # for each pixel where the wall is seen in the middle
        metres = math.cos(lean) if upright else 1.0  # of the picture, for each along the grating
        camera = Camera(eye, 90.0, turned - 90.0, focal_length=CYCLES / 4 * 2.0 / metres / cycles)
        renderer.render(camera)
        drawn, expected = renderer.luminance()[..., 1].astype(float), grating(camera, upright)
        drawn, expected = drawn[~np.isnan(expected)], expected[~np.isnan(expected)]
        slope = np.polyfit(expected / expected.mean(), drawn / drawn.mean(), 1)[0]
        assert slope / np.sinc(CYCLES / TEXELS) ** 2 == pytest.approx(1, abs=0.02)


def grating(camera: Camera, upright: bool, parts: int = 12) -> np.ndarray:
    """The grating's mean over each pixel of a picture of 96 x 64, NaN beside the floor."""
    right, up, ahead = camera.axes()
    focal = camera.focal_pixels(96)
    total = np.zeros((64, 96))
    for k in range(parts * parts):
        down, along = divmod(k, parts)
        y, x = np.mgrid[0:64, 0:96] + np.array([down + 0.5, along + 0.5])[:, None, None] / parts
        ray = (x - 48)[..., None] / focal * right + (32 - y)[..., None] / focal * up + ahead
        far = np.where(ray[..., 2] < 0, camera.position[2] / np.maximum(-ray[..., 2], 1e-9), np.nan)
        at = (np.array(camera.position) + far[..., None] * ray)[..., 0 if upright else 1]
        on = (np.abs(camera.position[0] + far * ray[..., 0]) < 1.9) & (np.abs(far * ray[..., 1]) < 1.9)
        total += np.where(on, 0.4 + 0.3 * np.cos(2 * math.pi * CYCLES * (at + 2) / 4), np.nan)
    return total / parts**2
