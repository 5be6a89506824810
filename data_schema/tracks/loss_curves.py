"""Contrast loss of every frame as a function of the brightness factor, and what else the optimizer needs."""

from __future__ import annotations

import json
import tokenize
import zipfile
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, ClassVar

from evenlight.data_schema.display import HIGHEST_LUMINANCE, Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import mapping_from_record, record_from_mapping
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.quantities import (
    Array,
    array_shapes,
    as_in,
    described,
    one_line,
    quantity,
    record,
    rises,
    share,
)
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.storage.input_files import open_input
from evenlight.data_schema.storage.input_sizes import MOST_NUMBERS, require_array_sizes
from evenlight.data_schema.storage.whole_files import write_whole
from evenlight.data_schema.tracks.brightness_track import ACTUATOR, LUMINANCE_SLACK, TrackHeader
from evenlight.data_schema.tracks.loss_bends import LossBends

LONGEST = 1e7  # [s] of a video: four months; sums of what is longer lose single frames
FAINTEST = 1e-9  # share of white: of a frame as dark as that nothing is visible
LARGEST_RISE = 0.01  # of loss with the factor; computed curves never rise, those by definition by rounding
# What numpy raises for files that are no arrays, or damaged ones; a header may promise more than the memory.
UNREADABLE = (
    OSError, EOFError, ValueError, TypeError, OverflowError, MemoryError, RuntimeError, SyntaxError,
    tokenize.TokenError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
FORMER_TOLERANCE = 0.001  # of losses that earlier versions counted in part, unless they were asked for more
BENDS = "bend_"  # before the names of arrays of `LossBends`, in files
COMPUTED_ON = "what computed them: cpu, or gpu and its name"


@record
class CurvesHeader:
    """What loss curves were made for, and how; the `header` of their npz file, in JSON."""

    FORMER_KEYS: ClassVar = ("tolerance",)

    video: str = described("name of the video")
    display: Display = described("display that it is shown on")
    provenance: Provenance = described("how the file was made")
    computed_on: str = described(COMPUTED_ON, default="cpu")
    field_of_view: float | None = as_in(TrackHeader, "field_of_view")
    actuator: Actuator = described(ACTUATOR, default=Actuator.BACKLIGHT)


@record
class LossCurves:
    """The contrast-loss curves of N frames at K brightness factors."""

    video: str = as_in(CurvesHeader, "video")
    display: Display = described("display that it is shown on; pixels_per_degree as used in the analysis")
    times: Array = quantity("s", "when each frame appears", minimum=-LONGEST, maximum=LONGEST, shape=("N",))
    durations: Array = quantity("s", "how long each frame is shown", above=0.0, maximum=LONGEST, shape=("N",))
    factors: Array = share("brightness factors b of the knots, rising to 1", above=0.0, shape=("K",))
    loss: Array = share("contrast loss 𝓛_c of each frame at each factor; 0 at factor 1", shape=("N", "K"))
    visible_contrast: Array = share(
        "visible contrast C_v of the undimmed frame; 0 if nothing is visible, then the loss is 0",
        shape=("N",),
    )
    mean_luminance: Array = quantity(
        "cd/m^2",
        "Ī, mean luminance that the display emits at factor 1, reflected light excluded",
        minimum=0.0,
        maximum=HIGHEST_LUMINANCE,
        shape=("N",),
    )
    channel_means: Array = share("means of the linear red, green and blue channels", shape=("N", "3"))
    provenance: Provenance = described("how the file was made")
    computed_on: str = as_in(CurvesHeader, "computed_on")
    field_of_view: float | None = as_in(CurvesHeader, "field_of_view")
    actuator: Actuator = described(ACTUATOR, default=Actuator.BACKLIGHT)
    # the same curves at any factor; None where only the knots are known
    bends: LossBends | None = None

    def __post_init__(self) -> None:
        n, k = len(self.times), len(self.factors)
        for name, axes in ARRAY_SHAPES.items():
            shape = tuple({"N": n, "K": k}.get(axis, 3) for axis in axes)
            if getattr(self, name).shape != shape:
                raise ValueError(f"{name} must have the shape {shape}, got {getattr(self, name).shape}")
        if n == 0:
            raise ValueError("loss curves need at least one frame, got none")
        if not rises(self.times):
            raise ValueError("times_s must rise from frame to frame")
        if k < 2 or not rises(self.factors) or self.factors[-1] != 1:
            raise ValueError("factors must rise to 1 with at least two knots")
        if self.bends is not None and len(self.bends.contents) != n:
            raise ValueError(f"bends must be of {n} frames, got {len(self.bends.contents)}")

    def __repr__(self) -> str:
        return one_line(self, self.video, self.times, factors=self.factors, loss=self.loss)

    @property
    def n_frames(self) -> int:
        """Number of frames N."""
        return len(self.times)


ARRAY_SHAPES = array_shapes(LossCurves)  # N frames, K brightness factors


def require_possible_curves(curves: LossCurves) -> None:
    """Raise `InputError` if losses are none, or luminances are such as the curves' display cannot make.

    Loss falls with the factor, to 0 at full brightness; a frame in which nothing is visible loses nothing.
    """
    import numpy as np

    loss, seen = curves.loss, curves.visible_contrast > 0
    rise = (loss - np.minimum.accumulate(loss, axis=1)).max(axis=1)
    display, mean = curves.display, curves.mean_luminance
    light = f"what {display.name!r} emits, {display.black_level:g} to {display.peak_luminance:g} cd/m^2"
    low = np.maximum(display.black_level, np.where(seen, FAINTEST * display.peak_luminance, 0.0))
    for name, wrong, got, right in (
        ("loss", loss[:, -1] > LARGEST_RISE, loss[:, -1], "0 at factor 1, where nothing is lost"),
        ("loss", rise > LARGEST_RISE, rise, "no rise with the factor, and this is one"),
        ("loss", ~seen & loss.any(axis=1), loss.max(axis=1), "0 where nothing is visible"),
        ("mean_luminance", mean < low * (1 - LUMINANCE_SLACK), mean, light),
        ("mean_luminance", mean > display.peak_luminance * (1 + LUMINANCE_SLACK), mean, light),
    ):
        if wrong.any():
            k = int(wrong.argmax())
            raise InputError(f"{name} of frame {k}: expected {right}, got {got[k]:.4g}; compute them again")


def write_loss_curves(path: Path, curves: LossCurves) -> None:
    """Write loss curves as a compressed npz file, whole."""
    import numpy as np

    made_for = CurvesHeader(
        curves.video, curves.display, curves.provenance, curves.computed_on, curves.field_of_view,
        curves.actuator,
    )  # fmt: skip
    header = mapping_from_record(made_for)
    arrays = {name: getattr(curves, name) for name in ARRAY_SHAPES}
    if curves.bends is not None:
        arrays |= {BENDS + name: getattr(curves.bends, name) for name in LossBends.__slots__}
    described_by = np.array(json.dumps(header))
    write_whole(path, lambda file: np.savez_compressed(file, header=described_by, **arrays))


def read_loss_curves(path: Path) -> LossCurves:
    """Return the loss curves of an npz file; raise `InputError` if it holds none."""
    made_for, arrays = _npz_content(path, ARRAY_SHAPES)
    found = {name: arrays.pop(BENDS + name, None) for name in LossBends.__slots__}
    missing = [BENDS + name for name, values in found.items() if values is None]
    if 0 < len(missing) < len(found):
        raise InputError(f"{path}: {missing[0]} is missing; compute the curves again")
    try:
        curves = LossCurves(
            made_for.video, made_for.display, **arrays,
            provenance=made_for.provenance, computed_on=made_for.computed_on,
            field_of_view=made_for.field_of_view, actuator=made_for.actuator,
            bends=None if missing else LossBends(**found),
        )  # fmt: skip
        require_possible_curves(curves)
    except (ValueError, TypeError) as error:
        raise InputError(f"{path}: {error}") from error
    return curves


def read_curves_header(path: Path) -> CurvesHeader:
    """Return what the loss curves of an npz file were made for; raise `InputError` if it holds none."""
    return _npz_content(path, ())[0]


def _npz_content(path: Path, names: Iterable[str]) -> tuple[CurvesHeader, dict[str, Any]]:
    import numpy as np

    what = "loss curves (npz)"
    stream = open_input(path, what)
    try:
        with stream, np.load(stream, allow_pickle=False) as content:
            require_array_sizes(content, MOST_NUMBERS, path)
            header = json.loads(str(content["header"]))
            bends = [name for name in content if names and name.startswith(BENDS)]
            arrays = {name: content[name] for name in (*names, *bends)}
    except KeyError as error:
        raise InputError(f"{path}: {str(error.args[0]).rstrip()}; expected {what}") from None
    except InputError:
        raise
    except UNREADABLE as error:
        reason = str(error).partition("\n")[0] or type(error).__name__
        raise InputError(f"{path}: holds no loss curves ({reason}); expected {what}") from None
    if isinstance(header, dict) and header.get("tolerance", 0.0) > FORMER_TOLERANCE:
        raise InputError(
            f"{path}: an earlier version made these curves right to {header['tolerance']} alone; make them "
            "anew with `evenlight optimize`"
        )
    return record_from_mapping(CurvesHeader, header, f"{path}: header"), arrays
