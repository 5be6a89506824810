"""Draws a scene in linear light, and encodes the picture for a display.

Sharp shadows are looked up in a depth picture of what the sun sees, made once.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from evenlight.stimuli.scenes import graphics
from evenlight.stimuli.scenes.camera import Camera
from evenlight.stimuli.scenes.graphics import KNEE, PEAK
from evenlight.stimuli.scenes.light.bake import charts_of, light_picture
from evenlight.stimuli.scenes.light.bake_lights import sky_picture
from evenlight.stimuli.scenes.scene import Floats, Quality, Scene, direction_of
from evenlight.stimuli.scenes.textures.tileable import SIZE, MaterialTextures, material_textures
from evenlight.stimuli.scenes.vertices import (
    ATTRIBUTES,
    LAYOUT,
    SHRUNK,
    buffers_of,
    in_view,
    not_hidden,
    occluders,
)
from evenlight.stimuli.sequence_format import ENCODING_GAMMA, codes_on_grid

if TYPE_CHECKING:
    import moderngl

EDGE_CONTRAST = 0.12  # share of the brighter root of luminance: an edge to be smoothed
DEPTH_TEST = 2  # of moderngl, which is imported by those who make a context
BRIGHTEST = 150.0  # [cd/m^2] brighter light is drawn like this: a display shows 99 % of its peak for it, and
# the edges of lamps could not be smoothed
ALBEDO, LIGHT, SHADOW, MATERIALS = 0, 1, 2, 3  # texture units
SHADOW_SIZE = 4096  # [texels]


class SceneRenderer:
    """Draws one scene into pictures of one size.

    Nothing is kept of the graphics state that it finds, and what it changes for drawing is switched off
    again afterwards, so that it shares a window's context with others.

    Parameters
    ----------
    context : moderngl.Context
        Of a window, or `offscreen_context()`.
    scene : Scene
        What is drawn.
    size : (int, int)
        Width and height of the pictures [pixels].
    quality : Quality or None
        Of its light: how long the first renderer of a scene takes; later ones find it in the cache.
    """

    def __init__(
        self,
        context: moderngl.Context,
        scene: Scene,
        size: tuple[int, int],
        quality: Quality | None = Quality.FINE,
    ) -> None:
        self._context, self.size = context, size
        self._graphics = GraphicsScene(context, scene, quality)
        self._raw = context.texture(size, 4, dtype="f2")
        self._raw.repeat_x = self._raw.repeat_y = False
        self._drawn = context.framebuffer(self._raw, context.depth_renderbuffer(size))
        self.texture = context.texture(size, 4, dtype="f2")
        self._smoothed = context.framebuffer(self.texture)
        self.codes = context.texture(size, 4, dtype="u2")
        self._encoded = context.framebuffer(self.codes)
        for texture in (self.texture, self.codes):
            texture.filter = graphics.NEAREST, graphics.NEAREST
        self._edges = self._pass(graphics.EDGES_FRAGMENT, drawn=0, contrast=EDGE_CONTRAST)
        self._encoder = self._pass(
            graphics.ENCODE_FRAGMENT, light=0, peak=PEAK, knee=KNEE, gamma=ENCODING_GAMMA
        )

    def render(self, camera: Camera) -> None:
        """Draw the scene's linear RGB luminance [cd/m^2] into `texture`."""
        with graphics.own(self._context):
            self._drawn.use()
            self._drawn.clear()
            self._graphics.draw(camera, self.size)
            self._context.disable(DEPTH_TEST)
            self._smoothed.use()
            self._raw.use(0)
            self._edges.render(vertices=3)

    def luminance(self) -> NDArray[np.float32]:
        """Return what `texture` holds, (height, width, 3), row 0 on top [cd/m^2]."""
        width, height = self.size
        data = np.frombuffer(self._smoothed.read(components=4, dtype="f2"), dtype=np.float16)
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
        """Return a triangle over the whole picture with a program."""
        program = self._context.program(vertex_shader=graphics.WHOLE_VERTEX, fragment_shader=fragment)
        whole = self._context.vertex_array(program, [])
        set_uniforms(whole, **uniforms)
        return whole


class GraphicsScene:
    """Draws a scene into the framebuffer that is bound.

    Parameters
    ----------
    context : moderngl.Context
        Where.
    scene : Scene
        What.
    quality : Quality or None
        Of its light.
    """

    def __init__(self, context: moderngl.Context, scene: Scene, quality: Quality | None) -> None:
        self._context, self._scene = context, scene
        charts = charts_of(scene.patches, scene.holed())
        vertices, indices, self._blocks = buffers_of(scene, charts)
        self._vertices = context.buffer(vertices.tobytes())
        self._indices = context.buffer(indices.tobytes())
        self._walls = context.buffer(occluders(scene).tobytes())
        textures = material_textures(scene, SIZE if quality is Quality.FINE else SIZE // 2)
        self._upload(textures, light_picture(scene, charts, textures, quality))
        self._solid = self._surface(graphics.SURFACE_VERTEX, graphics.SURFACE_FRAGMENT)
        self._holed = self._surface(graphics.SURFACE_VERTEX, graphics.with_holes(graphics.SURFACE_FRAGMENT))
        self._sky_program = context.program(
            vertex_shader=graphics.WHOLE_VERTEX, fragment_shader=graphics.SKY_FRAGMENT
        )
        self._sky_whole = context.vertex_array(self._sky_program, [])
        self._cast_shadows()
        self._hiding = self._depth_only(self._walls)
        self._small: moderngl.Framebuffer | None = None

    def draw(self, camera: Camera, size: tuple[int, int]) -> None:
        """Draw what a camera sees: near blocks first, then the sky around them, then what has holes."""
        import moderngl

        context, matrix = self._context, camera.matrix(size)
        blocks = self._in_sight(matrix, size)
        for surface in (self._solid, self._holed):
            set_uniforms(surface, view=matrix, eye=camera.position)
        self._use_textures()
        holed = self._blocks.cutout[blocks]
        context.enable(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        self._draw_blocks(self._solid, blocks[~holed])
        context.disable(moderngl.CULL_FACE)
        self._draw_sky(camera, size)
        self._use_textures()  # the sky took one's place
        self._draw_blocks(self._holed, blocks[holed])

    def _use_textures(self) -> None:
        """Bind the textures of surfaces."""
        self._albedo.use(ALBEDO)
        self._light.use(LIGHT)
        self._shadow.use(SHADOW)
        self._materials.use(MATERIALS)

    def _in_sight(self, matrix: Floats, size: tuple[int, int]) -> NDArray[np.int64]:
        """Return the blocks that are in view and not hidden behind walls, nearest first."""
        import moderngl

        context, drawn = self._context, self._context.fbo
        width, height = (-(-side // SHRUNK) for side in size)
        if self._small is None or self._small.size != (width, height):
            self._depth = context.depth_texture((width, height))
            self._small = context.framebuffer(depth_attachment=self._depth)
        context.enable(moderngl.DEPTH_TEST)
        self._small.use()
        self._small.clear()
        set_uniforms(self._hiding, view=matrix)
        self._hiding.render()
        depth = np.frombuffer(self._depth.read(), dtype=np.float32)
        drawn.use()
        chosen = in_view(self._blocks, matrix)
        return not_hidden(self._blocks, chosen, matrix, depth.reshape(height, width))

    def _draw_blocks(self, surface: moderngl.VertexArray, blocks: np.ndarray) -> None:
        """Draw some blocks."""
        for first, count in zip(
            self._blocks.first[blocks].tolist(), self._blocks.count[blocks].tolist(), strict=True
        ):
            surface.render(vertices=count, first=first)

    def _draw_sky(self, camera: Camera, size: tuple[int, int]) -> None:
        """Draw the sky wherever nothing is in front of it."""
        right, up, ahead = camera.axes()
        focal = camera.focal_pixels(size[0])
        set_uniforms(
            self._sky_whole,
            brightest=BRIGHTEST,
            right=right * (size[0] / 2 / focal),
            up=up * (size[1] / 2 / focal),
            ahead=ahead,
        )
        self._sky.use(0)
        self._sky_whole.render(vertices=3)

    def _upload(self, textures: MaterialTextures, light: np.ndarray) -> None:
        """Put textures, light and sky into the graphics processor's memory."""
        context, scene = self._context, self._scene
        layers, size = textures.codes.shape[:2]
        self._albedo = context.texture_array((size, size, layers), 4, textures.codes.tobytes())
        self._albedo.build_mipmaps()
        self._albedo.filter = graphics.LINEAR_MIPMAP_LINEAR, graphics.LINEAR
        gloss = [[m.gloss] for m in scene.materials]
        table = np.concatenate([textures.scale, gloss], axis=1).astype("f4")
        self._materials = context.texture((layers, 1), 4, table.tobytes(), dtype="f4")
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

    def _surface(self, vertex: str, fragment: str) -> moderngl.VertexArray:
        """Return the scene's vertices with a program for surfaces."""
        program = self._context.program(vertex_shader=vertex, fragment_shader=fragment)
        surface = self._context.vertex_array(program, [(self._vertices, LAYOUT, *ATTRIBUTES)], self._indices)
        set_uniforms(
            surface, brightest=BRIGHTEST, albedo=ALBEDO, light=LIGHT, shadow=SHADOW, materials=MATERIALS
        )
        return surface

    def _cast_shadows(self) -> None:
        """Draw the sun's view of the scene, and tell the programs about the sun."""
        import moderngl

        sun = self._scene.sun
        self._shadow = empty_shadow_map(self._context)
        if sun is None:
            for surface in (self._solid, self._holed):
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
            self._albedo.use(ALBEDO)
            for holed in (False, True):
                caster = self._caster(holed)
                set_uniforms(caster, view=matrix)
                self._draw_blocks(caster, np.flatnonzero(self._blocks.cutout == holed))
        for surface in (self._solid, self._holed):
            set_uniforms(
                surface,
                sun=sun.luminance(),
                sun_direction=sun.direction(),
                to_shadow=lookup_matrix(matrix),
                shadow_texel=texel_size(matrix),
            )

    def _caster(self, holed: bool) -> moderngl.VertexArray:
        """Return the scene's vertices with a program that draws depth only."""
        if not holed:
            return self._depth_only(self._indices)
        program = self._context.program(
            vertex_shader=graphics.SHADOW_VERTEX,
            fragment_shader=graphics.with_holes(graphics.SHADOW_FRAGMENT),
        )
        content = [(self._vertices, "3f4 8x1 2f4 20x1 1f4", "position", "uv", "material")]
        caster = self._context.vertex_array(program, content, self._indices)
        set_uniforms(caster, albedo=ALBEDO)
        return caster

    def _depth_only(self, indices: moderngl.Buffer) -> moderngl.VertexArray:
        """Return some of the scene's triangles with a program that draws depth, holes not regarded."""
        program = self._context.program(
            vertex_shader=graphics.SHADOW_VERTEX, fragment_shader=graphics.SHADOW_FRAGMENT
        )
        return self._context.vertex_array(program, [(self._vertices, "3f4 40x1", "position")], indices)


def set_uniforms(surface: moderngl.VertexArray, **values: Any) -> None:
    """Set uniforms of a program, those that it uses; matrices are given for columns."""
    for name, value in values.items():
        if name not in surface.program:
            continue
        uniform: Any = surface.program[name]
        if isinstance(value, np.ndarray) and value.ndim == 2:
            uniform.write(value.T.astype("f4").tobytes())
        else:
            uniform.value = tuple(map(float, value)) if np.ndim(value) else value


def sun_matrix(scene: Scene) -> Floats:
    """Return the matrix from the scene to the sun's picture, clip space, for columns, (4, 4).

    It covers three corners of every patch: of one that reaches far beyond all others, such as the ground, the
    fourth corner may lie outside, and has no shadows.
    """
    assert scene.sun is not None
    ahead = -scene.sun.direction()
    right = direction_of(scene.sun.azimuth - 90, 0.0)
    axes = np.stack([right, np.cross(right, ahead), ahead])
    patches = scene.patches
    points = np.concatenate([patches.origin, patches.origin + patches.along, patches.origin + patches.across])
    seen = points @ axes.T
    low, high = seen.min(axis=0) - 0.1, seen.max(axis=0) + 0.1
    matrix = np.eye(4)
    matrix[:3, :3] = axes * (2 / (high - low))[:, None]
    matrix[:3, 3] = -(high + low) / (high - low)
    return matrix


def texel_size(matrix: Floats) -> float:
    """Return the larger side of a texel of the sun's picture [m]."""
    return float((2 / np.linalg.norm(matrix[:2, :3], axis=1)).max() / SHADOW_SIZE)


def lookup_matrix(matrix: Floats) -> Floats:
    """Return the matrix from the scene to texture coordinates and depth in [0, 1]."""
    return np.asarray(np.array([[0.5, 0, 0, 0.5], [0, 0.5, 0, 0.5], [0, 0, 0.5, 0.5], [0, 0, 0, 1]]) @ matrix)


def empty_shadow_map(context: moderngl.Context) -> moderngl.Texture:
    """Return a depth texture for the lookup of shadows that says that all is lit."""
    depth = context.depth_texture((1, 1), np.ones(1, dtype="f4").tobytes())
    depth.compare_func = "<="
    return depth
