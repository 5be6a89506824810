"""The mean luminance of pictures that a renderer drew, added up where they are."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.display import Display
from evenlight.method.contrast.luminance import LUMINANCE_WEIGHTS
from evenlight.stimuli.dithering import GRID_LEVELS
from evenlight.stimuli.scenes.engine import graphics
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer
from evenlight.stimuli.shaders import over_all, set_uniforms

if TYPE_CHECKING:
    import moderngl

    from evenlight.method.gpu.context import Fence

BLOCK = 16  # columns and rows of pixels that are added up at one place
LATE = 2  # pictures after which the sums of one are taken, where nothing may be waited for
BUFFERS = 8  # of sums under way; the oldest of so many is waited for
SUM_FRAGMENT = f"""
#version 330
uniform usampler2D codes;
uniform sampler2D seen;
uniform float gamma;
out vec4 total;
void main() {{
    ivec2 first = ivec2(gl_FragCoord.xy) * {BLOCK};
    ivec2 end = min(first + {BLOCK}, textureSize(codes, 0));
    total = vec4(0.0);
    for (int y = first.y; y < end.y; y++)
        for (int x = first.x; x < end.x; x++) {{
            vec3 encoded = vec3(texelFetch(codes, ivec2(x, y), 0).rgb) / {GRID_LEVELS - 1}.0;
            total += texelFetch(seen, ivec2(x, y), 0).r * vec4(pow(encoded, vec3(gamma)), 1.0);
        }}
}}
"""


class PictureLuminance:
    """Adds up a renderer's codes where they are; what is read back is four numbers for 256 pixels.

    To read it is to wait until the picture is drawn, which the display must do as well.

    Parameters
    ----------
    context, pictures, display
        As of `open_meter`.

    Attributes
    ----------
    seen_share : float
        The share of the pixels that count, `seen` of the renderer, in (0, 1].
    """

    def __init__(self, context: moderngl.Context, pictures: SceneRenderer, display: Display) -> None:
        self._context, self._pictures, self._display = context, pictures, display
        width, height = pictures.size
        self._whole = np.ones((height, width), dtype=bool)
        blocks = -(-width // BLOCK), -(-height // BLOCK)
        with graphics.own(context):
            self._sums = context.framebuffer(context.texture(blocks, 4, dtype="f4"))
            self._adder = over_all(context, SUM_FRAGMENT)
            self._seen = context.texture(pictures.size, 1, alignment=1)
            set_uniforms(self._adder, codes=0, seen=1, gamma=display.gamma)
        self._count_only(self._whole)
        self._means: Array = np.zeros(3)

    def mean(self) -> float:
        """Return Ī at factor 1 of the picture drawn last [cd/m^2]."""
        self._add_up()
        return self._taken(self._sums.read(components=4, dtype="f4"))

    def channel_means(self) -> Array:
        """Return the means of the linear R, G, B channels of the picture that `mean` saw last, (3,)."""
        return self._means

    def luminance_of(self, means: Array) -> float:
        """Return Ī of a picture whose channels have some means, (3,) [cd/m^2]."""
        share = float(means @ LUMINANCE_WEIGHTS)
        return self._display.black_level + (self._display.peak_luminance - self._display.black_level) * share

    def _count_only(self, seen: NDArray[np.bool_]) -> None:
        self._counted, self.seen_share = seen, float(seen.mean())
        self._seen.write((255 * seen[::-1].astype(np.uint8)).tobytes(), alignment=1)

    def _add_up(self) -> None:
        seen = self._whole if self._pictures.seen is None else self._pictures.seen
        if seen is not self._counted:
            self._count_only(seen)
        with graphics.own(self._context):
            self._sums.use()
            self._pictures.codes.use(0)
            self._seen.use(1)
            self._adder.render(vertices=3)

    def _taken(self, data: bytes) -> float:
        """Take the means from some sums, and return Ī of them [cd/m^2]."""
        sums = np.frombuffer(data, np.float32).reshape(-1, 4).sum(axis=0, dtype=np.float64)
        self._means = sums[:3] / sums[3]
        return self.luminance_of(self._means)


class LateLuminance(PictureLuminance):
    """The luminance of pictures that nothing waits for: it is known two pictures later, or later still.

    The sums are read into buffers in turn, each of which is looked into when the graphics processor has
    filled it. The first picture alone is waited for, before anything is shown.

    Parameters
    ----------
    context, pictures, display, patient
        As of `open_meter`; if patient, sums are taken exactly two pictures later.

    Attributes
    ----------
    known : list of array, (3,)
        Means of the channels of each picture so far, in order, as far as they are known.
    """

    def __init__(
        self, context: moderngl.Context, pictures: SceneRenderer, display: Display, *, patient: bool
    ) -> None:
        super().__init__(context, pictures, display)
        size = 16 * self._sums.width * self._sums.height
        self._free = [context.buffer(reserve=size, dynamic=True) for _ in range(BUFFERS)]
        self._under_way: deque[tuple[Fence, moderngl.Buffer]] = deque()
        self._patient = patient
        self.known: list[Array] = []

    def mean(self) -> float:
        """Return Ī at factor 1 of the last picture of which it is known [cd/m^2]."""
        from evenlight.method.gpu.context import Fence

        self._add_up()
        buffer = self._free.pop()
        self._sums.read_into(buffer, components=4, dtype="f4")
        self._under_way.append((Fence(), buffer))
        while not self.known or not self._free or self._is_there():
            self._take_oldest()
        return self.luminance_of(self.known[-1])

    def finish(self) -> None:
        """Take what is under way; waits for it."""
        while self._under_way:
            self._take_oldest()

    def _is_there(self) -> bool:
        """Return whether the oldest sums under way can be taken without waiting."""
        late = len(self._under_way) > LATE
        return late and (self._patient or self._under_way[0][0].passed())

    def _take_oldest(self) -> None:
        """Take the oldest sums under way."""
        fence, buffer = self._under_way.popleft()
        fence.release()
        self._taken(buffer.read())
        self.known.append(self._means)
        self._free.append(buffer)
