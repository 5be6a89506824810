"""How much visible contrast dimming costs: of one frame, and of every frame of a video."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from evenlight.analysis.tracks.dimming_options import actuator_of
from evenlight.data_schema.arguments import number, numbers, whole
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import ContrastModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import sha256_of_record
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.keywords import right_names
from evenlight.method.choices import AnalysisEffort
from evenlight.method.contrast.loss_curves import brightness_factors
from evenlight.method.contrast.one_factor import OneFactorLoss
from evenlight.method.preset_files import load_contrast_model, load_display
from evenlight.progress import counted, shown_progress
from evenlight.stimuli.dimming_options import MIN_FACTORS
from evenlight.stimuli.video.frames_in_memory import Frames, Named, frame_of, video_of
from evenlight.stimuli.video.video_analysis import VideoAnalysis
from evenlight.stimuli.video.video_source import VideoSource, field_of_view_of
from evenlight.stimuli.video.viewing_geometry import require_angle, seen_video


@right_names
def loss_curves(
    video: Named | VideoSource | Frames,
    *,
    display: Named | Display = "varjo-xr3",
    contrast_model: Named | ContrastModel = "default",
    fps: float | None = None,
    field_of_view: float | None = None,
    actuator: Actuator | str | None = None,
    min_factor: float = 0.2,
    jobs: int = 0,
) -> LossCurves:
    """Return the contrast loss of every frame of a video at every brightness factor, for several budgets.

    Parameters
    ----------
    video, display, contrast_model, fps, field_of_view, actuator, min_factor, jobs
        As in `optimize`.

    Returns
    -------
    LossCurves
        Of N frames; `loss` is (N, K) at its K `factors`.
    """
    source, panel = video_of(video, fps), load_display(display)
    model = load_contrast_model(contrast_model)
    inputs = {
        "video": source.sha256(),
        "display": sha256_of_record(panel),
        "contrast_model": sha256_of_record(model),
    }
    knots = brightness_factors(number("min_factor", min_factor, *MIN_FACTORS))
    effort = AnalysisEffort(whole("jobs", jobs))
    made = provenance_now(inputs=inputs)
    require_angle(field_of_view)
    degrees = field_of_view_of(source) if field_of_view is None else field_of_view
    analysis = VideoAnalysis(model, knots, actuator_of(panel, actuator), made, effort)
    with shown_progress(quiet=True) as progress:
        every = counted(progress, source.frames(), f"analysing {source.name}", source.n_frames)
        return analysis.curves(*seen_video(every, panel, degrees, source.name), source.name)


def frame_loss(
    pixel_values: ArrayLike,
    factors: ArrayLike,
    *,
    display: Named | Display = "varjo-xr3",
    contrast_model: Named | ContrastModel = "default",
) -> Array:
    """Return the contrast loss 𝓛_c of one frame at brightness factors (Eqs. 1 to 5).

    Parameters
    ----------
    pixel_values : array_like, (height, width, 3), uint8, uint16 or float in [0, 1]
        Gamma-encoded R, G, B; integers over their full range.
    factors : array_like, any shape
        b, in (0, 1].
    display, contrast_model : str, path or record
        As in `optimize`. The frame is taken pixel for pixel.

    Returns
    -------
    array, the shape of `factors`
        Share of the visible contrast that is lost, in [0, 1].

    Examples
    --------
    >>> checks = np.indices((64, 64)).sum(axis=0)[:, :, None] // 8 % 2 * np.full(3, 0.2) + 0.4
    >>> float(frame_loss(checks, 1.0))
    0.0
    """
    frame = frame_of(pixel_values)
    wanted = numbers("factors", factors)
    if not (wanted.size and wanted.min() > 0 and wanted.max() <= 1):
        raise InputError("factors must hold at least one number, and all must lie above 0 and not above 1")
    height, width, _ = frame.pixel_values.shape
    measure = OneFactorLoss(
        (height, width), load_display(display), load_contrast_model(contrast_model), float(wanted.min())
    )
    return np.array([measure.of(frame.pixel_values, float(b)).loss for b in wanted.flat]).reshape(
        wanted.shape
    )
