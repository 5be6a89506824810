"""Draws a scene in linear light, and encodes the picture for a display.

Sharp shadows are looked up in a depth picture of what the sun sees, made once.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from evenlight.stimuli.scenes.engine import graphics
from evenlight.stimuli.scenes.engine.antialiasing import NONE, OFFLINE, Antialiasing, average_fragment, tiles
from evenlight.stimuli.scenes.engine.camera import View, sun_matrix
from evenlight.stimuli.scenes.engine.graphics import KNEE, PEAK
from evenlight.stimuli.scenes.engine.light.bake import charts_of, light_picture
from evenlight.stimuli.scenes.engine.light.bake_lights import sky_picture
from evenlight.stimuli.scenes.engine.material_textures import SIZE, MaterialTextures, material_textures
from evenlight.stimuli.scenes.engine.reflections import TEXEL, lobes_of, reflections, shine_of
from evenlight.stimuli.scenes.engine.scene import Floats, Quality, Scene
from evenlight.stimuli.scenes.engine.texture_arrays import UNITS, TextureArrays, detail_texture
from evenlight.stimuli.scenes.engine.vertices import (
    ATTRIBUTES,
    BLENDED,
    HOLED,
    LAYOUT,
    SHRUNK,
    SOLID,
    blocks_of,
    faces_of,
    in_view,
    kinds_of,
    not_hidden,
    occluders,
    shown_first_to_last,
    vertices_of,
)
from evenlight.stimuli.sequence_format import ENCODING_GAMMA, codes_on_grid
from evenlight.stimuli.shaders import over_all, set_uniforms, shader

if TYPE_CHECKING:
    import moderngl

DEPTH_TEST = 2  # of moderngl, which is imported by those who make a context
BRIGHTEST = 150.0  # [cd/m^2] brighter light is drawn like this: a display shows 99 % of its peak for it, and
# the edges of lamps could not be smoothed
FINEST = 16.0  # of anisotropic filtering by the graphics card
SHADOW_SIZE = 4096  # [texels] of the sun's picture
PARTS = 8  # from near to far, in each of which what has one shader and textures of one kind is drawn at once
# Texture units, as those of `texture_arrays`.
LIGHT, SHADOW, MATERIALS, DETAIL, AROUND, ROOMS = 1, 2, 3, 4, 6, 7


class SceneRenderer:
    """Draws one scene into pictures of one size.

    Nothing is kept of the graphics state that it finds, and what it changes for drawing is switched off
    again afterwards, so that it shares a window's context with others.

    Parameters
    ----------
    context : moderngl.Context
        Of a window, or `offscreen_context()`.
    scene : Scene or GraphicsScene
        What is drawn; a `GraphicsScene` of this context may have several renderers.
    size : (int, int)
        Width and height of the pictures [pixels].
    quality : Quality or None
        Of its light: how long the first renderer of a scene takes; later ones find it in the cache. A
        `GraphicsScene` has its own.
    antialiasing : Antialiasing
        Samples of each pixel: `OFFLINE` for pictures that are kept, `LIVE` where a display waits for them,
        `EYES` where it does not. A `GraphicsScene` must be for as many samples at a place.
    """

    # Which pixels a headset's lens shows, (height, width), row 0 on top; None if all are seen.
    seen: NDArray[np.bool_] | None = None

    def __init__(
        self,
        context: moderngl.Context,
        scene: Scene | GraphicsScene,
        size: tuple[int, int],
        quality: Quality | None = Quality.FINE,
        antialiasing: Antialiasing = OFFLINE,
    ) -> None:
        self._context, self.size = context, size
        antialiasing = antialiasing.possible(context.max_samples)
        if isinstance(scene, Scene):
            scene = GraphicsScene(context, scene, quality, antialiasing.samples)
        self._graphics, self._antialiasing, self._tiles = scene, antialiasing, tiles(size, antialiasing)
        self._drawn, self._samples = scene.target(self._tiles[0].drawn_size(antialiasing))
        self.texture = context.texture(size, 4, dtype="f2")
        self._averaged = context.framebuffer(self.texture)
        self.codes = context.texture(size, 4, dtype="u2")
        self._encoded = context.framebuffer(self.codes)
        for texture in (self.texture, self.codes):
            texture.filter = graphics.NEAREST, graphics.NEAREST
        self._average = self._pass(average_fragment(antialiasing), drawn=0)
        self._encoder = self._pass(shader("encoded"), light=0, peak=PEAK, knee=KNEE, gamma=ENCODING_GAMMA)

    def render(self, camera: View) -> None:
        """Draw the scene's linear RGB luminance [cd/m^2] into `texture`."""
        with graphics.own(self._context):
            self._graphics.choose(camera, self.size, self._antialiasing)
            for tile in self._tiles:
                self._drawn.use()
                self._drawn.clear()
                self._graphics.draw(camera, self.size, tile.placing(self.size, self._antialiasing))
                self._context.disable(DEPTH_TEST)
                self._averaged.use()
                self._averaged.viewport = tile.left, tile.bottom, tile.width, tile.height
                set_uniforms(self._average, origin=tile.origin(self._antialiasing))
                self._samples.use(0)
                self._average.render(vertices=3)

    def luminance(self) -> NDArray[np.float32]:
        """Return what `texture` holds, (height, width, 3), row 0 on top [cd/m^2]."""
        width, height = self.size
        data = np.frombuffer(self._averaged.read(components=4, dtype="f2"), dtype=np.float16)
        return data.reshape(height, width, 4)[::-1, :, :3].astype(np.float32)

    def encode(self) -> None:
        """Draw the codes for what `texture` holds, 0 to 1023 for a display of gamma 2.2, into `codes`."""
        with graphics.own(self._context):
            self._encoded.use()
            self.texture.use(0)
            self._encoder.render(vertices=3)

    def pixel_values(self) -> NDArray[np.uint16]:
        """Return what `codes` holds, over the 16-bit range, (height, width, 3), row 0 on top."""
        width, height = self.size
        data = np.frombuffer(self.codes.read(), dtype=np.uint16).reshape(height, width, 4)
        return codes_on_grid(data[::-1, :, :3])

    def _pass(self, fragment: str, **uniforms: float) -> moderngl.VertexArray:
        whole = over_all(self._context, fragment)
        set_uniforms(whole, **uniforms)
        return whole


class GraphicsScene:
    """Draws a scene, in light of some quality, into the framebuffer that is bound.

    `samples` are those that the graphics card takes at each place where something is drawn.
    """

    def __init__(
        self, context: moderngl.Context, scene: Scene, quality: Quality | None, samples: int = 1
    ) -> None:
        self._context, self._scene, self._samples = context, scene, samples
        self._targets: dict[tuple[int, int], tuple[moderngl.Framebuffer, moderngl.Texture]] = {}
        charts = charts_of(scene.patches, scene.holed())
        self._faces = faces_of(scene.patches)
        self._blocks = blocks_of(scene, self._faces)
        vertices = vertices_of(scene, charts, self._faces)
        self._vertices = context.buffer(vertices)
        self._indices = context.buffer(reserve=6 * 4 * len(scene.patches), dynamic=True)  # of what is drawn
        self._walls = context.buffer(occluders(scene, self._faces).tobytes())
        textures = material_textures(scene, SIZE if quality is Quality.FINE else SIZE // 2)
        light = light_picture(scene, charts, textures, quality)
        self._upload(textures, light)
        source = shader("surface")
        if samples == 1 and any(material.sampling for material in scene.materials):
            source = graphics.with_defined(source, "SHARPER")
        sources = source, graphics.with_holes(source, samples), graphics.with_defined(source, "BLENDED")
        self._surfaces = {
            (kind, words): self._surface(source, words)
            for kind, source in enumerate(sources) for words in set(self._textures.words)
        }  # fmt: skip
        self._sky_program = context.program(vertex_shader=shader("sky_vertex"), fragment_shader=shader("sky"))
        self._sky_whole = context.vertex_array(self._sky_program, [])
        self._around = context.texture_array((1, 1, 1), 3, bytes(12), dtype="f4")
        self._rooms = context.texture((1, 1), 3, bytes(12), dtype="f4")
        self._cast_shadows()
        self._hiding = self._depth_only(self._walls)
        self._small: moderngl.Framebuffer | None = None
        if shine_of(scene).any():
            self._around, self._rooms = reflections(context, self, (scene, textures, light), vertices)
            self._vertices.write(vertices)

    def target(self, size: tuple[int, int]) -> tuple[moderngl.Framebuffer, moderngl.Texture]:
        """Return where to draw, and the picture in it; all renderers of one size draw into the same."""
        if size not in self._targets:
            samples = self._samples if self._samples > 1 else 0
            picture = self._context.texture(size, 4, samples=samples, dtype="f2")
            depth = self._context.depth_renderbuffer(size, samples=samples)
            self._targets[size] = self._context.framebuffer(picture, depth), picture
        return self._targets[size]

    def choose(self, camera: View, size: tuple[int, int], antialiasing: Antialiasing) -> None:
        """Choose what a camera sees, which is what `draw` draws: the nearest first."""
        self._sample_as(antialiasing)
        matrix = camera.matrix(size)
        blocks = self._in_sight(matrix, size)
        solid, holed, blended = (
            shown_first_to_last(
                self._faces, self._blocks, blocks[self._blocks.kind[blocks] == kind], matrix, camera.position
            )
            for kind in (SOLID, HOLED, BLENDED)
        )
        self._write(solid, holed, blended[::-1], parts=PARTS)

    def _sample_as(self, antialiasing: Antialiasing) -> None:
        for surface in self._surfaces.values():
            set_uniforms(surface, numbering=antialiasing.numbering(), sharper=antialiasing.sharper())

    def draw(self, camera: View, size: tuple[int, int], placing: Floats) -> None:
        """Draw what was chosen: what is solid, the sky around it, what has holes, what others show through.

        `placing` is the matrix, (3, 3), from the picture to where it is drawn, both from -1 to 1 each way.
        """
        import moderngl

        context, matrix = self._context, camera.matrix(size)
        for surface in self._surfaces.values():
            set_uniforms(surface, view=matrix, eye=camera.position, placing=placing)
        self._use_textures()
        context.enable(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        for edge in graphics.CLIP_DISTANCES:
            context.enable_direct(edge)
        self._draw_chosen(SOLID)
        context.disable(moderngl.CULL_FACE)
        self._draw_sky(camera, size, placing)
        self._draw_chosen(HOLED)
        if any(kind == BLENDED for kind, *_ in self._runs):
            self._draw_blended()
        for edge in graphics.CLIP_DISTANCES:
            context.disable_direct(edge)

    def _draw_blended(self) -> None:
        """Draw what others show through: behind before in front, light that is laid over a surface on it."""
        import moderngl

        context = self._context
        context.enable(moderngl.BLEND | moderngl.CULL_FACE)
        context.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        context.polygon_offset = -1.0, -1.0
        context.fbo.depth_mask = False
        self._draw_chosen(BLENDED)
        context.fbo.depth_mask = True
        context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        context.polygon_offset = 0.0, 0.0
        context.disable(moderngl.BLEND | moderngl.CULL_FACE)

    def _use_textures(self) -> None:
        self._light.use(LIGHT)
        self._shadow.use(SHADOW)
        self._materials.use(MATERIALS)
        self._detail.use(DETAIL)
        self._around.use(AROUND)
        self._rooms.use(ROOMS)

    def _in_sight(self, matrix: Floats, size: tuple[int, int]) -> NDArray[np.int64]:
        """Return the blocks that are in view and not hidden behind walls, nearest first."""
        import moderngl

        context = self._context
        width, height = (-(-side // SHRUNK) for side in size)
        if self._small is None or self._small.size != (width, height):
            self._depth = context.depth_texture((width, height))
            self._small = context.framebuffer(depth_attachment=self._depth)
        context.enable(moderngl.DEPTH_TEST)
        self._small.use()
        self._small.clear()
        set_uniforms(self._hiding, view=matrix)
        self._hiding.render()
        # In an eye's picture, where depth ends nearer, surfaces are taken for farther: less of it is hidden.
        depth = np.frombuffer(self._depth.read(), dtype=np.float32)
        chosen = in_view(self._blocks, matrix)
        return not_hidden(self._blocks, chosen, matrix, depth.reshape(height, width))

    def _write(self, *chosen: NDArray[np.int64], parts: int = 1) -> None:
        """Write the patches of each kind, in the order in which they are drawn."""
        self._runs, written, first = list[tuple[int, int, int, int]](), list[NDArray[np.uint32]](), 0
        for kind, patches in enumerate(chosen):
            for array, run in self._textures.runs(patches, 0 if kind == BLENDED else parts):
                written.append(self._faces.indices(run))
                self._runs.append((kind, array, first, len(written[-1])))
                first += len(written[-1])
        self._indices.orphan()
        if written:
            self._indices.write(np.concatenate(written).tobytes())

    def _draw_chosen(self, chosen: int, caster: moderngl.VertexArray | None = None) -> None:
        for kind, array, first, count in self._runs:
            if kind == chosen:
                self._textures.use(array)
                surface = caster or self._surfaces[kind, self._textures.words[array]]
                surface.render(vertices=count, first=first)

    def _draw_sky(self, camera: View, size: tuple[int, int], placing: Floats) -> None:
        right, up, ahead = camera.axes()
        left_edge, right_edge, down_edge, up_edge = camera.tangents(size)
        set_uniforms(
            self._sky_whole,
            placing=placing,
            brightest=BRIGHTEST,
            right=right * ((right_edge - left_edge) / 2),
            up=up * ((up_edge - down_edge) / 2),
            ahead=ahead + right * ((right_edge + left_edge) / 2) + up * ((up_edge + down_edge) / 2),
        )
        self._sky.use(0)
        self._sky_whole.render(vertices=3)

    def _upload(self, textures: MaterialTextures, light: np.ndarray) -> None:
        context, scene = self._context, self._scene
        self._textures = TextureArrays(context, scene, textures, 1.0 if self._samples == 1 else FINEST)
        self._detail, detail = detail_texture(context, scene)
        gloss, metal = ([[getattr(m, name)] for m in scene.materials] for name in ("gloss", "metal"))
        columns = textures.scale, gloss, detail, self._textures.layers, metal, lobes_of(gloss)
        table = np.concatenate(columns, axis=1).astype("f4")
        self._materials = context.texture((3, len(table)), 4, table.tobytes(), dtype="f4")
        self._materials.filter = graphics.NEAREST, graphics.NEAREST
        height, width = light.shape[:2]
        four = np.ones((height, width, 4), dtype="f2")
        four[..., :3] = light
        self._light = context.texture((width, height), 4, four.tobytes(), dtype="f2")
        picture = sky_picture(scene)
        self._sky = context.texture(
            picture.shape[1::-1], 3, picture.astype("f2").tobytes(), dtype="f2", alignment=2
        )
        self._sky.repeat_x, self._sky.repeat_y = True, False

    def _surface(self, fragment: str, words: tuple[str, ...]) -> moderngl.VertexArray:
        vertex = shader("surface_vertex")
        for word in words:
            vertex, fragment = (graphics.with_defined(source, word) for source in (vertex, fragment))
        program = self._context.program(vertex_shader=vertex, fragment_shader=fragment)
        surface = self._context.vertex_array(program, [(self._vertices, LAYOUT, *ATTRIBUTES)], self._indices)
        set_uniforms(
            surface, brightest=BRIGHTEST, light=LIGHT, shadow=SHADOW, materials=MATERIALS, detail=DETAIL,
            around=AROUND, rooms=ROOMS, texel=TEXEL, roughest=lobes_of([[0.0]])[0, :2], **UNITS,
        )  # fmt: skip
        return surface

    def _cast_shadows(self) -> None:
        import moderngl

        sun = self._scene.sun
        if sun is None:
            self._shadow = self._context.depth_texture((1, 1), np.ones(1, dtype="f4").tobytes())
            self._shadow.compare_func = "<="
            for surface in self._surfaces.values():
                set_uniforms(surface, sun=(0.0, 0.0, 0.0), sun_direction=(0.0, 0.0, 1.0), to_shadow=np.eye(4))
            return
        matrix = sun_matrix(self._scene)
        self._shadow = self._context.depth_texture((SHADOW_SIZE, SHADOW_SIZE))
        self._shadow.compare_func = "<="
        self._shadow.repeat_x = self._shadow.repeat_y = False
        target = self._context.framebuffer(depth_attachment=self._shadow)
        with graphics.own(self._context):
            target.use()
            target.clear()
            self._context.enable(moderngl.DEPTH_TEST)
            self._use_textures()
            kinds = kinds_of(self._scene)
            self._write(*(np.flatnonzero(kinds == kind) for kind in (SOLID, HOLED, BLENDED)))
            for kind in (SOLID, HOLED, BLENDED):
                caster = self._caster(kind)
                set_uniforms(caster, view=matrix)
                self._draw_chosen(kind, caster)
        halved = np.array([[0.5, 0, 0, 0.5], [0, 0.5, 0, 0.5], [0, 0, 0.5, 0.5], [0, 0, 0, 1]])
        for surface in self._surfaces.values():
            set_uniforms(
                surface,
                sun=sun.luminance(),
                sun_direction=sun.direction(),
                to_shadow=halved @ matrix,
                shadow_texel=float((2 / np.linalg.norm(matrix[:2, :3], axis=1)).max() / SHADOW_SIZE),
            )

    def _caster(self, kind: int) -> moderngl.VertexArray:
        if kind == SOLID:
            return self._depth_only(self._indices)
        program = self._context.program(
            vertex_shader=shader("shadow_vertex"),
            fragment_shader=graphics.with_holes(shader("shadow")),
        )
        content = [(self._vertices, "3f4 8x1 2f4 28x1 1f4", "position", "uv", "material")]
        caster = self._context.vertex_array(program, content, self._indices)
        set_uniforms(caster, **UNITS, materials=MATERIALS, numbering=NONE.numbering())
        return caster

    def _depth_only(self, indices: moderngl.Buffer) -> moderngl.VertexArray:
        """Return some of the scene's triangles with a program that draws depth, holes not regarded."""
        program = self._context.program(
            vertex_shader=shader("shadow_vertex"), fragment_shader=shader("shadow")
        )
        return self._context.vertex_array(program, [(self._vertices, "3f4 48x1", "position")], indices)
