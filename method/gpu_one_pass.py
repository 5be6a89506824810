"""The one pass over a frame's pixels on the graphics processor: how many become visible at which factor.

The steps are those of `method.frame_analysis`, the tables those of `method.critical_factor`. Pixels are
counted in whole numbers, so that a frame gives the same counts however its groups are scheduled. What is read
back is the counts, a few hundred numbers. See docs/decisions/gpu.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import (
    ContrastModel,
    MaskingNeighbourhood,
    SensitivityModel,
    Visibility,
)
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.method.critical_factor import LARGEST_LOG_RATIO, BandTable, band_tables
from evenlight.method.gpu_bands import Request, band_layout
from evenlight.method.gpu_context import require_compute
from evenlight.method.gpu_frame import FrameTexture, Packed
from evenlight.method.gpu_pyramid import PYRAMID, RESULTS, GpuPyramid, sums_of
from evenlight.method.gpu_shaders import program

if TYPE_CHECKING:
    import moderngl


MOST_KNOTS = 1024  # that a group can count in memory of its own
UNDER_WAY = 2  # frames at most: one is worked on while the one before is read
_BANDS, _TABLES, _FACTORS = 1, 2, 4  # places of buffers in `count.glsl`
_ACROSS = 4096  # groups in a row of the dispatch; drivers allow 65535
_OWN_COUNTS = 2048  # numbers that a group counts in: each knot's as often as there is room, 32 times at most


@dataclass(frozen=True, slots=True)
class CountedBand:
    """What was counted in one band.

    Attributes
    ----------
    pixels : int
        Of the band.
    visible : array, (references, knots)
        How many of them are visible at each factor, neighbours compared at each reference.
    """

    pixels: int
    visible: Array


@dataclass(frozen=True, slots=True)
class Counted:
    """What the pass over a frame gives.

    Attributes
    ----------
    bands : tuple of CountedBand
        Those in which contrast can be visible.
    means : array, (4,)
        Of linear R, G, B, and of linear luminance, in [0, 1].
    """

    bands: tuple[CountedBand, ...]
    means: Array


class GpuOnePass:
    """Programs, tables and buffers for frames of one size, and the pass over a frame.

    Parameters
    ----------
    context : moderngl.Context
        With compute shaders.
    shape : (height, width)
        Of the frames [pixels].
    display : Display
        The display that shows them.
    model : ContrastModel
        Choices of the contrast model.
    request : Request
        What is asked of each frame.
    """

    def __init__(
        self,
        context: moderngl.Context,
        shape: tuple[int, int],
        display: Display,
        model: ContrastModel,
        request: Request,
    ) -> None:
        require_compute(context)
        self._context, self._request, self._shape = context, request, shape
        tables = band_tables(shape, request.lowest_factor, display, model)
        _require_one_pass(tables, model, request)
        self.n_bands = len(tables)
        self._pyramid = GpuPyramid(context, shape, display, model.pixel_to_luminance, len(tables) + 2)
        seen = {level: table for level, table in enumerate(tables) if table.can_be_seen}
        self._levels = tuple(seen)
        self._layout = band_layout(self._pyramid.shapes, self._pyramid.begins, seen, request)
        self._make_buffers()
        self._count = program(context, ("mirror", "count"), _defined(model, request, self._layout.steps))
        self._under_way: list[int] = []
        self._next = 0

    def start(self, frame: FrameTexture | Packed, log_knots: Array, log_references: Array) -> None:
        """Begin with a frame, and return at once.

        Parameters
        ----------
        frame : FrameTexture or Packed
            The frame.
        log_knots : array, (knots,)
            log2 of the factors at which pixels are counted, rising to 0.
        log_references : array, (1 + references,)
            log2 of the factors at which neighbours are compared: in bands of many pixels, then of few.
        """
        if len(self._under_way) == UNDER_WAY:
            raise ValueError(f"{UNDER_WAY} frames are under way: ask for a result first")
        results = self._results[self._next]
        results.write(self._nothing)
        self._pyramid.fill(frame, results)
        groups = self._layout.groups
        if groups > 0:
            self._factors.write(np.concatenate([log_references, log_knots]).astype(np.float32))
            self._bind(results)
            self._count["n_groups"] = groups
            self._count.run(min(groups, _ACROSS), -(-groups // _ACROSS))
        self._context.memory_barrier(self._context.BUFFER_UPDATE_BARRIER_BIT)
        self._under_way.append(self._next)
        self._next = (self._next + 1) % UNDER_WAY

    def require_idle(self) -> None:
        """Raise `ValueError` if frames are under way, whose results would be taken for that of the next."""
        if self._under_way:
            raise ValueError(
                f"{len(self._under_way)} of the frames before are under way: ask for results first"
            )

    def result(self) -> Counted:
        """Return what the oldest frame under way gave; waits if it is not ready."""
        if not self._under_way:
            raise ValueError("no frame is under way: start one first")
        words = np.frombuffer(self._results[self._under_way.pop(0)].read(), np.uint32)
        bands, knots = [], self._request.knots
        for place in self._layout.places:
            counts = words[place.counts_at : place.counts_at + place.references * knots].reshape(-1, knots)
            bands.append(CountedBand(place.pixels, counts.cumsum(axis=1, dtype=float)))
        height, width = self._shape
        return Counted(tuple(bands), sums_of(words) / (height * width))

    def bytes_moved(self, bytes_per_pixel: int) -> int:
        """Return the bytes that have to pass between shaders and memory, each level once in each pass.

        Parameters
        ----------
        bytes_per_pixel : int
            Of the frame: 3 as it is uploaded with 8 bits, 4 or 8 as a texture of four channels.
        """
        sizes = [height * width for height, width in self._pyramid.shapes]
        levels = bytes_per_pixel * sizes[0] + 4 * sum(sizes) + 4 * sum(sizes[1:-1])
        bands = zip(self._levels, self._layout.places, strict=True)
        counts = sum(place.references * sum(sizes[level : level + 3]) for level, place in bands)
        return levels + 4 * counts + 4 * self._layout.words

    def _make_buffers(self) -> None:
        """Make the buffers of tables, factors and results."""
        context = self._context
        self._tables = context.buffer(self._layout.tables.tobytes())
        self._records = context.buffer(self._layout.records or bytes(4))  # a buffer of nothing there is not
        n_factors = 1 + self._request.references + self._request.knots
        self._factors = context.buffer(reserve=4 * n_factors, dynamic=True)
        self._nothing = np.zeros(self._layout.words, np.uint32)
        self._results = [context.buffer(self._nothing, dynamic=True) for _ in range(UNDER_WAY)]

    def _bind(self, results: moderngl.Buffer) -> None:
        """Bind the buffers where `count.glsl` looks for them."""
        self._pyramid.buffer.bind_to_storage_buffer(PYRAMID)
        self._records.bind_to_storage_buffer(_BANDS)
        self._tables.bind_to_storage_buffer(_TABLES)
        results.bind_to_storage_buffer(RESULTS)
        self._factors.bind_to_storage_buffer(_FACTORS)


def _defined(model: ContrastModel, request: Request, steps: tuple[int, int, int]) -> dict[str, object]:
    """Return what `count.glsl` is compiled with."""
    chosen = {
        "EQUAL_RATIOS": request.equal_ratios,
        "POSITIVE_ONLY": model.visibility is Visibility.POSITIVE_ONLY,
        "WITHOUT_CENTRE": model.masking is MaskingNeighbourhood.WITHOUT_CENTRE,
    }
    sizes: dict[str, object] = {
        "KNOTS": request.knots,
        "REPLICAS": 1 << min(5, (_OWN_COUNTS // request.knots).bit_length() - 1),
    }
    return (
        sizes
        | dict(zip(("THRESHOLDS", "SENSITIVITIES", "LUMINANCES"), steps, strict=True))
        | {name: "" for name, is_so in chosen.items() if is_so}
    )


def _require_one_pass(tables: list[BandTable], model: ContrastModel, request: Request) -> None:
    """Raise `InputError` for what only the processor computes."""
    if model.sensitivity is SensitivityModel.AUTHORS:
        raise InputError(
            "the graphics processor takes each pixel's own sensitivity: need sensitivity 'barten' or "
            "'simplified', got 'authors'; or use the processor (--device cpu)"
        )
    unseen = [float(table.log_sensitivity.max()) + LARGEST_LOG_RATIO <= 0 for table in tables]
    if not all(table.rises or never for table, never in zip(tables, unseen, strict=True)):
        raise InputError(
            "this contrast model's sensitivity falls with luminance somewhere on this display, so that one "
            "pass does not do: use the processor (--device cpu)"
        )
    if request.knots > MOST_KNOTS:
        raise InputError(f"the graphics processor takes at most {MOST_KNOTS} factors, got {request.knots}")
