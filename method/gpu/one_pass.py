"""The one pass over a frame's pixels on the graphics processor: how many become visible at which factor.

The steps are those of `contrast.frame_analysis`, the tables those of `contrast.critical_factor`; masking
(Eq. 3, `contrast.masking`) stands in `shaders/count.glsl` once more. Pixels are counted in whole numbers, so
that a frame gives the same counts however its groups are scheduled. What is read back is the counts, a few
hundred numbers. See docs/decisions/one-pass-curves.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import (
    ContrastModel,
    LossForm,
    MaskingNeighbourhood,
    SensitivityModel,
    Visibility,
)
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.method.contrast.band_shares import FEW_PIXELS
from evenlight.method.contrast.critical_factor import (
    LARGEST_LOG_RATIO,
    BandTable,
    band_tables,
    threshold_table,
)
from evenlight.method.gpu.context import program, require_compute
from evenlight.method.gpu.pyramid import (
    PYRAMID,
    RESULTS,
    SUM_WORDS,
    FrameTexture,
    GpuPyramid,
    sums_of,
)

if TYPE_CHECKING:
    import moderngl

MOST_KNOTS = 1024  # that a group can count in memory of its own
UNDER_WAY = 2  # frames at most: one is worked on while the one before is read
_BANDS, _TABLES, _FACTORS, _SEEN = 1, 2, 4, 5  # places of buffers in `count.glsl`
_ACROSS = 4096  # groups in a row of the dispatch; drivers allow 65535
_OWN_COUNTS = 2048  # numbers that a group counts in: each knot's as often as there is room, 32 times at most
TILE = 28  # pixels across and down that a group counts
_RECORD = np.dtype(
    [(name, np.int32) for name in ("width", "height", "fine_at", "coarse_at", "coarser_at", "first_group")]
    + [
        (name, np.int32)
        for name in ("tiles_across", "tiles", "first_reference", "counts_at", "tables_at", "step")
    ]
    + [(name, np.float32) for name in ("log_darkest", "per_log_luminance")]
    + [(name, np.float32) for name in ("log_faintest", "per_log_sensitivity")]
)


class GpuOnePass:
    """Programs, tables and buffers for frames of one size, and the pass over a frame.

    Parameters
    ----------
    context, shape, display, model
        As of `frame_loss.GpuLoss`.
    request : CountingRequest
        What is asked of each frame.
    """

    def __init__(
        self,
        context: moderngl.Context,
        shape: tuple[int, int],
        display: Display,
        model: ContrastModel,
        request: CountingRequest,
    ) -> None:
        require_compute(context)
        self._context, self._request, self._shape = context, request, shape
        tables = band_tables(shape, request.lowest_factor, display, model)
        _require_one_pass(tables, model, request)
        self.n_bands = len(tables)
        self._pyramid = GpuPyramid(context, shape, display, model.pixel_to_luminance, len(tables) + 2)
        seen = {level: table for level, table in enumerate(tables) if table.can_be_seen}
        # Of each band, finest first: its level, at how many factors neighbours are compared, and where its
        # counts begin among the words of the results, one for each knot of each of these factors.
        self._places: list[tuple[int, int, int]] = []
        steps = self._make_buffers(seen, threshold_table(model.masking_strength))
        self._defined = _defined(model, request, steps)
        self._count = program(context, ("mirror", "count"), self._defined)
        self._seen: moderngl.Buffer | None = None
        self._pixels = [height * width for height, width in self._pyramid.shapes]  # of each level that count
        self._under_way: list[int] = []
        self._next = 0

    def start(self, frame: FrameTexture | NDArray[Any], log_knots: Array, log_references: Array) -> None:
        """Begin with a frame, and return at once.

        Parameters
        ----------
        frame : FrameTexture, or array as of `packed`
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
        if self._groups > 0:
            self._factors.write(np.concatenate([log_references, log_knots]).astype(np.float32))
            self._bind(results)
            self._count["n_groups"] = self._groups
            self._count.run(min(self._groups, _ACROSS), -(-self._groups // _ACROSS))
        self._context.memory_barrier(self._context.BUFFER_UPDATE_BARRIER_BIT)
        self._under_way.append(self._next)
        self._next = (self._next + 1) % UNDER_WAY

    def count_only(self, seen: NDArray[np.bool_]) -> None:
        """Let only some pixels count from the next frame on, as `contrast.one_factor` does."""
        bits = np.packbits(seen, bitorder="little").tobytes() + bytes(3)
        if self._seen is None:
            self._count = program(self._context, ("mirror", "count"), self._defined | {"HIDDEN": ""})
            self._count["across"] = seen.shape[1]
            self._seen = self._context.buffer(reserve=len(bits), dynamic=True)
        self._seen.write(bits)
        steps = 2 ** np.arange(len(self._pixels))
        self._pixels = [max(int(np.count_nonzero(seen[::step, ::step])), 1) for step in steps]

    def require_idle(self) -> None:
        """Raise `ValueError` if frames are under way, whose results would be taken for that of the next."""
        if self._under_way:
            raise ValueError(
                f"{len(self._under_way)} of the frames before are under way: ask for results first"
            )

    def result(self) -> tuple[list[Array], Array]:
        """Return what the oldest frame under way gave; waits if it is not ready.

        Returns
        -------
        visible : list of array, (references, knots)
            Of each band in which contrast can be visible, the share of its pixels that are visible at each
            factor, neighbours compared at each reference.
        means : array, (4,)
            Of linear R, G, B, and of linear luminance, in [0, 1].
        """
        if not self._under_way:
            raise ValueError("no frame is under way: start one first")
        words = np.frombuffer(self._results[self._under_way.pop(0)].read(), np.uint32)
        bands, knots = [], self._request.knots
        for level, references, at in self._places:
            counts = words[at : at + references * knots].reshape(-1, knots)
            bands.append(counts.cumsum(axis=1, dtype=float) / self._pixels[level])
        height, width = self._shape
        return bands, sums_of(words) / (height * width)

    def _make_buffers(
        self, seen: Mapping[int, BandTable], thresholds: NDArray[np.float32]
    ) -> tuple[int, int, int]:
        """Lay out the bands whose contrast can be visible, given by their level of the pyramid.

        Returns the sizes of the table of thresholds, and of a band's two tables.
        """
        pyramid, request, tables = self._pyramid, self._request, [thresholds]
        records, words, groups = np.zeros(len(seen), _RECORD), SUM_WORDS, 0
        for number, (level, table) in enumerate(seen.items()):
            height, width = pyramid.shapes[level]
            few = height * width <= FEW_PIXELS
            references = request.references if few else 1
            across, down = -(-width // TILE), -(-height // TILE)
            split = groups, across, across * down
            starts = few, words, sum(part.size for part in tables)
            begins = pyramid.begins[level : level + 3]
            records[number] = width, height, *begins, *split, *starts, 2**level, *_ranges(table)
            self._places.append((level, references, words))
            tables += [table.log_sensitivity, table.log_luminance]
            words += references * request.knots
            groups += across * down * references
        context = self._context
        self._tables = context.buffer(np.concatenate(tables).tobytes())
        self._records = context.buffer(records.tobytes() or bytes(4))  # a buffer of nothing there is not
        n_factors = 1 + request.references + request.knots
        self._factors = context.buffer(reserve=4 * n_factors, dynamic=True)
        self._groups, self._nothing = groups, np.zeros(words, np.uint32)
        self._results = [context.buffer(self._nothing, dynamic=True) for _ in range(UNDER_WAY)]
        sensitivities, luminances = ([part.size for part in tables[1:]] + [2, 2])[:2]  # 2: no band is seen
        return thresholds.size, sensitivities, luminances

    def _bind(self, results: moderngl.Buffer) -> None:
        self._pyramid.buffer.bind_to_storage_buffer(PYRAMID)
        self._records.bind_to_storage_buffer(_BANDS)
        self._tables.bind_to_storage_buffer(_TABLES)
        results.bind_to_storage_buffer(RESULTS)
        self._factors.bind_to_storage_buffer(_FACTORS)
        if self._seen is not None:
            self._seen.bind_to_storage_buffer(_SEEN)


def _defined(
    model: ContrastModel, request: CountingRequest, steps: tuple[int, int, int]
) -> dict[str, object]:
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


def _require_one_pass(tables: list[BandTable], model: ContrastModel, request: CountingRequest) -> None:
    if model.visibility is Visibility.SOFT or model.loss is LossForm.SUPRATHRESHOLD:
        chosen = model.visibility if model.visibility is Visibility.SOFT else model.loss
        raise InputError(
            f"the graphics processor counts whole pixels, which {chosen.value!r} does not: use the processor "
            "(device cpu)"
        )
    if model.sensitivity is SensitivityModel.AUTHORS:
        raise InputError(
            "the graphics processor takes each pixel's own sensitivity: need sensitivity 'barten' or "
            "'simplified', got 'authors'; or use the processor (device cpu)"
        )
    unseen = [float(table.log_sensitivity.max()) + LARGEST_LOG_RATIO <= 0 for table in tables]
    if not all(table.rises or never for table, never in zip(tables, unseen, strict=True)):
        raise InputError(
            "this contrast model's sensitivity falls with luminance somewhere on this display, so that one "
            "pass does not do: use the processor (device cpu)"
        )
    if request.knots > MOST_KNOTS:
        raise InputError(f"the graphics processor takes at most {MOST_KNOTS} factors, got {request.knots}")


@dataclass(frozen=True, slots=True)
class CountingRequest:
    """What a pass counts: at which factors pixels are counted, and at how many neighbours are compared."""

    lowest_factor: float  # smallest brightness factor that will be asked for, above 0
    knots: int  # at how many factors, the last of which is 1
    references: int  # at how many factors neighbours are compared in bands of few pixels; in others, at one
    equal_ratios: bool  # whether the factors are in equal ratios


def _ranges(table: BandTable) -> tuple[float, float, float, float]:
    (dark, bright), (low, high) = table.log_luminance_range, table.log_sensitivity_range
    return dark, 1 / (bright - dark), low, 1 / (high - low)
