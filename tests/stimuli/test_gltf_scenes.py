"""A lab's own scene in glTF is drawn and lit as the file says; what cannot be used is refused in one line."""

import json
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gltf_files import LAMP, Glb, image_bytes, room
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from evenlight.command import app
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.stimuli.scenes.content.catalogue import path_named, scene_of
from evenlight.stimuli.scenes.engine.camera_path import check_path
from evenlight.stimuli.scenes.engine.light.bake import baked, charts_of
from evenlight.stimuli.scenes.engine.material_textures import material_textures
from evenlight.stimuli.scenes.engine.model import SceneModel
from evenlight.stimuli.scenes.engine.scene import Material, Quality, Scene
from evenlight.stimuli.scenes.gltf.gltf_export import glb_of
from evenlight.stimuli.scenes.gltf.gltf_file import read_gltf, sha256_of_gltf
from evenlight.stimuli.scenes.gltf.gltf_scene import scene_from_gltf
from evenlight.stimuli.scenes.scene_sequence import SceneSequence
from evenlight.stimuli.sequences import open_video

pytest.importorskip("trimesh")
PATH = {
    "scene": "room.glb", "duration_s": 1.0,
    "keypoints": [
        {"name": "a", "time_s": 0, "position_m": [0, -1, 1.6], "azimuth_deg": 0, "altitude_deg": 0},
        {"name": "b", "time_s": 1, "position_m": [0, 1, 1.6], "azimuth_deg": 0, "altitude_deg": 0},
    ],
}  # fmt: skip


LIGHT_9 = {"KHR_lights_punctual": {"light": 9}}
TURNED = {"baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform": {"rotation": np.nan}}}}


def read(folder: Path, glb: Glb) -> Scene:
    file = folder / "room.glb"
    file.write_bytes(glb.content())
    return scene_from_gltf(read_gltf(file))


def walk(folder: Path, **changes) -> str:
    (folder / "walk.json").write_text(json.dumps(PATH | changes))
    return str(folder / "walk.json")


def centres(scene: Scene) -> np.ndarray:
    p = scene.patches
    return p.origin + np.where(p.triangle, 1 / 3, 1 / 2)[:, None] * (p.along + p.across)


def test_metres_with_y_up_become_metres_with_z_up_and_squares_become_one_piece(tmp_path):
    """The floor of 4 m by 4 m lies at z = 0, the lamp of 1 m by 1 m 2.5 m above its middle, looking down."""
    scene = read(tmp_path, room())
    assert scene.patches.triangle.tolist() == [False, False]
    np.testing.assert_allclose(centres(scene), [[0, 0, 0], [0, 0, 2.5]], atol=1e-6)
    facing = np.cross(scene.patches.along, scene.patches.across)
    np.testing.assert_allclose(facing, [[0, 0, 16], [0, 0, -1]], atol=1e-5)


def test_nodes_turn_move_and_mirror_what_hangs_on_them(tmp_path):
    """A node moves its child by 1 along glTF's z, which is south here; a mirrored one still faces up."""
    glb = room()
    glb.header["nodes"].append({"children": [0], "translation": [0, 0, 1], "scale": [-1, 1, 1]})
    glb.header["scenes"][0]["nodes"] = [len(glb.header["nodes"]) - 1]
    scene = read(tmp_path, glb)
    np.testing.assert_allclose(centres(scene), [[0, -1, 0]], atol=1e-6)
    assert np.cross(scene.patches.along, scene.patches.across)[0, 2] == pytest.approx(16)


def test_base_colours_are_albedo_and_emission_is_luminance(tmp_path):
    """Colour 0.5, 0.25, 0.125 of the floor; factor 1, 0.5, 0.25 times strength 200 of the lamp."""
    patches = read(tmp_path, room()).patches
    np.testing.assert_allclose(patches.tint[0], [0.5, 0.25, 0.125])
    np.testing.assert_allclose(patches.emission, [[0, 0, 0], [200, 100, 50]])


def test_a_texture_is_linear_light_with_holes_where_the_mask_says(tmp_path):
    """sRGB code 188 is 0.503 of linear light (IEC 61966-2-1); the left half is cut out."""
    pixels = np.full((8, 16, 4), 188, dtype=np.uint8)
    pixels[..., 3] = np.where(np.arange(16) < 8, 10, 250)
    glb = room()
    glb.add_texture(0, image_bytes(pixels))
    glb.header["materials"][0] |= {"alphaMode": "MASK", "alphaCutoff": 0.5}
    scene = read(tmp_path, glb)
    textures = material_textures(scene, 64)
    k = scene.patches.material[0]
    assert scene.materials[k].cutout
    np.testing.assert_allclose(textures.albedo[k], 0.503, atol=0.004)
    assert textures.coverage[k] == pytest.approx(0.5, abs=0.02)


def test_a_lamp_with_a_thin_texture_is_whole(tmp_path):
    glb = room()
    paint = {"baseColorFactor": [1, 1, 1, 0.3]}
    glb.header["materials"][LAMP] |= {"alphaMode": "BLEND", "pbrMetallicRoughness": paint}
    glb.add_texture(LAMP, image_bytes(np.full((4, 4, 4), 255, dtype=np.uint8)))
    assert not read(tmp_path, glb).holed().any()


def test_thin_surfaces_have_two_sides_where_the_file_says_so(tmp_path):
    glb = room()
    glb.header["materials"][0]["doubleSided"] = True
    patches = read(tmp_path, glb).patches
    facing = np.cross(patches.along, patches.across)
    assert sorted(np.sign(facing[:, 2]).tolist()) == [-1, -1, 1]  # the lamp, and the floor from both sides


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda glb: glb.header["scenes"][0].update(nodes=[]), "no triangles"),
        (lambda glb: glb.set_floats(0, np.nan), "not numbers"),
        (lambda glb: glb.set_indices(0, 77), "content cannot be read"),
        (lambda glb: glb.scale(1000), "4000 x 4000 x 2500 m; need 0.5 to 2000 m"),
        (lambda glb: glb.scale(0.01), "0.04 x 0.04 x 0.025 m; need 0.5"),
        (lambda glb: glb.header["buffers"][0].update(uri="away.bin"), "buffer 'away.bin' is not beside it"),
        (lambda glb: glb.header["bufferViews"][0].update(byteLength=10**6), "content cannot be read"),
        (lambda glb: glb.header["nodes"][0].update(extensions=LIGHT_9), "content cannot be read"),
        (
            lambda glb: glb.header["materials"][0]["pbrMetallicRoughness"].update(TURNED),
            "content cannot be read",
        ),
        (lambda glb: glb.add_texture(0, b"no image"), "image 0 cannot be read"),
        (
            lambda glb: glb.header.update(extensionsRequired=["KHR_draco_mesh_compression"]),
            "needs KHR_draco_mesh_compression, which is not read; export it uncompressed",
        ),
        (lambda glb: glb.header.update(images=[5]), "not a whole glTF file"),
        (lambda glb: glb.header["buffers"][0].update(uri=7), "not a whole glTF file"),
        (lambda glb: glb.header.update(asset={"version": "1.0"}), "need glTF of version 2, got version 1.0"),
        (lambda glb: glb.header["accessors"][0].update(sparse={}), "sparse accessors are not read"),
        (lambda glb: glb.header["materials"][0].update(emissiveFactor=[-1, 0, 0]), "0 or above for a colour"),
    ],
)
def test_damaged_files_are_refused_in_one_line_with_their_name(tmp_path, damage, message):
    glb = room()
    damage(glb)
    with pytest.raises(InputError, match=message) as error:
        read(tmp_path, glb)
    assert str(tmp_path / "room.glb") in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("uri", ["../kept.bin", "%2e%2e/kept.bin", "{outside}/kept.bin"])
def test_a_file_reads_nothing_outside_of_its_folder(tmp_path, uri):
    (tmp_path / "kept.bin").write_bytes(b"no business of the file's")
    (tmp_path / "scene").mkdir()
    glb = room()
    glb.header["images"] = [{"uri": uri.format(outside=tmp_path)}]
    glb.header["textures"] = [{"source": 0}]
    path = tmp_path / "scene" / "room.glb"
    path.write_bytes(glb.content())
    for reading in (sha256_of_gltf, lambda path: read_gltf(path).image(0)):
        with pytest.raises(InputError, match=r"its image '.*' is not beside it; copy it there"):
            reading(path)


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), min_size=1, max_size=8), st.integers(0, 4)
)
def test_no_mutant_does_worse_than_being_refused(tmp_path, changes, cut):
    content = bytearray(room().content())
    for at, value in changes:
        content[at % len(content)] = value
    file = tmp_path / "mutant.glb"
    file.write_bytes(content[: len(content) * (5 - cut) // 5] if cut < 4 else content)
    with suppress(InputError):  # any other exception fails the test
        assert np.isfinite(scene_from_gltf(read_gltf(file)).patches.origin).all()


def places(tree, at=()) -> Iterator[tuple[str | int, ...]]:
    """Yield where each value of a tree is."""
    for key, value in tree.items() if isinstance(tree, dict) else enumerate(tree):
        yield (*at, key)
        if isinstance(value, dict | list):
            yield from places(value, (*at, key))


@pytest.mark.slow
@pytest.mark.parametrize("value", [5, "x", [], {}, None, -1, 1e30], ids=repr)
def test_a_value_of_any_kind_anywhere_is_read_or_refused_in_one_line(tmp_path, value):
    glb = room()
    glb.add_texture(0, image_bytes(np.full((2, 2, 3), 100, dtype=np.uint8)))
    glb.header["images"].append({"uri": "beside.png"})
    glb.header["buffers"].append({"uri": "data:application/octet-stream;base64,AAAA", "byteLength": 3})
    glb.header["scenes"][0]["extras"] = {"evenlight": {"windows": [], "sky": {}, "sun": None}}
    whole, file = json.dumps(glb.header), tmp_path / "mutant.glb"
    (tmp_path / "beside.png").write_bytes(b"any")
    said = list[str]()
    for place in [
        place for place in places(glb.header) if not {2, 3, 4, 5} & {*place}
    ]:  # two of each are enough
        header = json.loads(whole)
        inner = header
        for key in place[:-1]:
            inner = inner[key]
        inner[place[-1]] = value
        file.write_bytes(Glb(header, glb.data).content())
        for use in (sha256_of_gltf, lambda path: scene_from_gltf(read_gltf(path))):
            try:
                use(file)
            except InputError as error:  # any other exception fails the test
                said.append(str(error))
    assert len(said) > 20
    assert all(words.startswith(str(file)) and "\n" not in words for words in said)


@pytest.mark.parametrize(
    ("light", "message"),
    [
        ({"sun": {"azimuth_deg": 0, "altitude_deg": -5, "illuminance_lx": 9}}, "sun above the horizon"),
        ({"windows": [[[np.nan] * 3] * 4]}, "need windows at most 2000 m away"),
    ],
)
def test_light_in_the_extras_of_a_file_is_checked_as_that_of_a_path(tmp_path, light, message):
    glb = room()
    glb.header["scenes"][0]["extras"] = {"evenlight": light}
    with pytest.raises(InputError, match=message):
        read(tmp_path, glb)


@pytest.mark.parametrize("content", [b"", b"junk", b"\xff\xfe\xfd", b"glTF"])
def test_what_is_no_gltf_is_said_to_be_none(tmp_path, content):
    (tmp_path / "room.glb").write_bytes(content)
    with pytest.raises(InputError, match=r"not glTF; need a .glb or .gltf file"):
        read_gltf(tmp_path / "room.glb")


def test_a_path_names_the_scene_beside_it_and_serves_as_a_video(tmp_path):
    (tmp_path / "room.glb").write_bytes(room().content())
    video = open_video(walk(tmp_path, sky={"zenith_cd_m2": [1, 2, 4], "horizon_cd_m2": [8, 8, 8]}))
    before = video.sha256()
    assert scene_of(path_named(str(tmp_path / "walk.json"))).sky.zenith == (1.0, 2.0, 4.0)
    glb = room()
    glb.header["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = [0.1, 0.1, 0.1, 1]
    (tmp_path / "room.glb").write_bytes(glb.content())
    assert video.sha256() != before  # the content of the scene is part of what was shown
    assert scene_of(path_named(str(tmp_path / "walk.json"))).patches.tint[0, 0] == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"scene": "hall.glb"}, "there is no scene .*hall.glb; put the file there"),
        (
            {"sun": {"azimuth_deg": 0, "altitude_deg": -5, "illuminance_lx": 9}},
            "need a sun above the horizon",
        ),
        ({"skyy": {}}, "'skyy' is unknown; there are scene, duration_s, keypoints, places, sky, sun"),
        ({"scene": {"a": 1}}, "need the name of a scene as 'scene', got {'a': 1}"),
        ({"sky": 5}, "the sky: need a table with zenith_cd_m2, horizon_cd_m2, got 5"),
        (
            {"sky": {"zenith_cd_m2": [1, 2], "horizon_cd_m2": [1, 2, 3]}},
            r"the sky: need 3 numbers as 'zenith_cd_m2', got \[1, 2\]",
        ),
        (
            {"keypoints": [PATH["keypoints"][0] | {"fps": 9}]},
            "keypoint 'a': 'fps' is unknown; there are position_m, name",
        ),
        (
            {"keypoints": [{"name": "hall", "time_s": 0, "position_m": [0, 0, 1]}]},
            "keypoint 'hall': there is no 'azimuth_deg'",
        ),
        (
            {"keypoints": [PATH["keypoints"][0] | {"position_m": "x"}]},
            "keypoint 'a': need 3 numbers as 'position_m', got 'x'",
        ),
        ({"sky": {"zenith_cd_m2": [1, 1, 1]}}, "there is no 'horizon_cd_m2'"),
    ],
)
def test_paths_that_cannot_be_walked_are_refused(tmp_path, changes, message):
    (tmp_path / "room.glb").write_bytes(room().content())
    with pytest.raises(InputError, match=message):
        scene_of(path_named(walk(tmp_path, **changes)))


def test_a_keypoint_far_from_the_scene_and_a_scene_without_light_are_refused(tmp_path):
    scene = read(tmp_path, room())
    path = path_named(walk(tmp_path))
    first = replace(path.keypoints[0], position=(0.0, -403.0, 1.6))
    with pytest.raises(InputError, match=r"keypoint 'a' at \(0.0, -403.0, 1.6\) m is far from the scene"):
        check_path(replace(path, keypoints=(first, *path.keypoints[1:])), scene)
    beside = replace(first, position=(0.0, -30.0, 9.0))  # outside of it, from where it is drawn
    check_path(replace(path, keypoints=(beside, *path.keypoints[1:])), scene)
    dark = room()
    del dark.header["materials"][LAMP]["emissiveFactor"]
    (tmp_path / "room.glb").write_bytes(dark.content())
    with pytest.raises(InputError, match="nothing lights it"):
        scene_of(path)


def render(*arguments):
    return CliRunner().invoke(app, ["render", *map(str, arguments)], catch_exceptions=False)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("room.glb", "--out", "a.mkv"), "room.glb is a scene: give a camera path"),
        (
            ("house", "--size", "64x36", "--out", "a.glb"),
            "a.glb is a scene: leave out the options of a video",
        ),
        (("room.glb", "--out", "a.glb"), "room.glb: is a scene in glTF already; give a --path"),
        (("gone.glb", "--path", "library", "--out", "a.mkv"), "library: need a camera path through gone.glb"),
        (
            ("school", "--path", "library", "--out", "a.glb"),
            "library: need a camera path through school, a .json",
        ),
        (("cellar.glb", "--path", "walk.json", "--out", "a.mkv"), "there is no scene cellar.glb"),
    ],
)
def test_what_cannot_be_rendered_says_what_to_give(tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    walk(tmp_path)
    with pytest.raises(InputError, match=message):
        render(*arguments)
    assert [file.name for file in tmp_path.iterdir()] == ["walk.json"]


def test_a_scene_goes_out_with_its_walk_beside_it_which_is_not_overwritten(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    walk(tmp_path)
    Path("room.glb").write_bytes(room().content())
    assert render("room.glb", "--path", "walk.json", "--out", "out.glb").exit_code == 0
    assert Path("out.path.json").read_text() == Path("walk.json").read_text()
    assert len(scene_from_gltf(read_gltf(Path("out.glb"))).patches) == 2
    Path("out.glb").unlink()
    with pytest.raises(InputError, match=r"out.path.json: is there already"):
        render("room.glb", "--path", "walk.json", "--out", "out.glb")
    assert not Path("out.glb").exists()


def test_a_path_without_a_scene_goes_through_the_one_given(tmp_path):
    path = {key: value for key, value in PATH.items() if key != "scene"}
    (tmp_path / "walk.json").write_text(json.dumps(path))
    (tmp_path / "hall.glb").write_bytes(room().content())
    assert path_named(str(tmp_path / "walk.json"), str(tmp_path / "hall.glb")).scene.endswith("hall.glb")
    with pytest.raises(InputError, match="there is no 'scene'"):
        path_named(str(tmp_path / "walk.json"))


def test_a_film_says_how_large_it_is_seen_and_where_it_is_dark(tmp_path, monkeypatch):
    """64 pixels over 90 degrees: 32 pi / 180 in the middle = 0.559. 0.1 to the 2.2 is 0.63 of 100 cd/m^2."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "room.glb").write_bytes(room().content())
    walk(tmp_path)

    def said(shares, *options):
        picture = np.repeat(shares, 12)[:, None, None] * np.full((36, 64, 3), 65535.0)
        frames = [Frame(k / 4, 1 / 4, picture.astype(np.uint16)) for k in range(4)]
        monkeypatch.setattr(SceneSequence, "frames", lambda self: iter(frames))
        options = ("--size", "64x36", "--fps", 4, "--out", "film.mkv", "--force", *options)
        return render("room.glb", "--path", "walk.json", *options).output

    dim = said([0.1] * 3)
    assert "walk: 64x36 pixels at 90°, 0.559 pixels/°" in dim
    assert "warning: room.glb: the film is dark, 0.63 cd/m² on the average, 0% of it below 0.2 cd/m²" in dim
    assert "raise the lamps' emissive_strength" in dim
    assert "67% of it below" in said([0, 0, 1], "--quiet")  # a bright corner does not make up for it
    assert said([0, 0.5, 0.5], "--quiet") == ""


def striped(rng: np.random.Generator, size: int) -> np.ndarray:
    return np.broadcast_to(np.where(np.arange(size) % 32 < 16, 0.2, 0.6)[None, :, None], (size, size, 3))


@pytest.fixture(scope="module")
def model() -> Scene:
    made = SceneModel("model", 1)
    stripes = Material("stripes", lambda rng, size: striped(rng, size).astype(np.float32), 1.0, gloss=0.2)
    made.quad([(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)], stripes, tint=(0.9, 0.7, 0.5))
    made.box((-0.5, -0.5, 0), (0.5, 0.5, 1), stripes, tint=(0.3, 0.6, 0.9), skip="z")
    made.sphere((1.2, 1.2, 0.5), 0.4, stripes, segments=12)
    made.lamp([(-0.5, -0.5, 2.5), (-0.5, 0.5, 2.5), (0.5, 0.5, 2.5), (0.5, -0.5, 2.5)], 300.0, (1, 0.9, 0.8))
    made.sun(200.0, 50.0, 900.0, (1.0, 0.95, 0.9))
    made.sky((2, 3, 5), (6, 6, 7))
    return made.build()


@pytest.mark.slow
def test_what_goes_out_comes_back(tmp_path, model):
    """Same surface, albedo, emission, normals, sun and sky; and its light within the noise of few rays."""
    (tmp_path / "model.glb").write_bytes(glb_of(model))
    back = scene_from_gltf(read_gltf(tmp_path / "model.glb"))

    def totals(scene):
        p, textures = scene.patches, material_textures(scene, 512)
        area = np.linalg.norm(np.cross(p.along, p.across), axis=1) * np.where(p.triangle, 0.5, 1)
        albedo = np.where(p.emission.any(axis=1)[:, None], 0, textures.albedo[p.material] * p.tint)
        light = baked(
            scene, charts_of(p, scene.holed()), (textures.albedo, textures.coverage), Quality.COARSE
        )
        by_area = [area @ albedo, area @ p.emission, area @ np.abs(p.normals).sum(axis=1)]
        return area.sum(), *np.concatenate(by_area), light.mean()

    before, after = totals(model), totals(back)
    np.testing.assert_allclose(after[:-1], before[:-1], rtol=0.004)  # 8-bit textures
    assert after[-1] == pytest.approx(before[-1], rel=0.05)
    assert back.sky == model.sky
    assert back.sun.illuminance == pytest.approx(model.sun.illuminance)
    np.testing.assert_allclose(back.sun.direction(), model.sun.direction(), atol=1e-9)
