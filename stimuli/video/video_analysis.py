"""The loss curves of a video as it is seen, dimmed by a backlight or by pixels."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import DEFAULT_MODEL, ContrastModel
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.method.choices import ONE_CORE, AnalysisEffort
from evenlight.method.contrast.checkpoints import AnalysedFrames, Checkpoints
from evenlight.method.contrast.loss_curves import analyze_frames, brightness_factors
from evenlight.method.contrast.pixel_floor import FlooredFrames
from evenlight.stimuli.video.viewing_geometry import ViewingGeometry


@dataclass(frozen=True, slots=True)
class VideoAnalysis:
    """How the loss curves of a video are computed.

    Attributes
    ----------
    model, factors : ContrastModel, array (K,)
        Choices of the contrast model, and the knots b.
    actuator : Actuator
        What dims the video.
    provenance, effort : Provenance or None, AnalysisEffort
        As of `analyze_frames`.
    """

    model: ContrastModel = DEFAULT_MODEL
    factors: Array = field(default_factory=brightness_factors)
    actuator: Actuator = Actuator.BACKLIGHT
    provenance: Provenance | None = None
    effort: AnalysisEffort = ONE_CORE

    def curves(
        self,
        frames: Iterable[Frame],
        geometry: ViewingGeometry,
        video: str,
        checkpoints: Checkpoints | None = None,
    ) -> LossCurves:
        """Return the curves of frames as the display shows them; both are of `seen_video`.

        Parameters
        ----------
        frames, geometry, video : iterable of Frame, ViewingGeometry, str
            The frames, how they are seen, and the video's name.
        checkpoints : Checkpoints, optional
            As of `analyze_frames`.
        """
        display, by_pixels = geometry.display, self.actuator is Actuator.PIXELS
        begun = None if checkpoints is None else checkpoints.begun
        earlier = None if begun is None else begun.floor
        floored = FlooredFrames(display, self.model, self.factors, self.effort.threads, earlier)
        if by_pixels and checkpoints is not None:
            checkpoints = replace(checkpoints, keep=_with_floor(checkpoints.keep, floored))
        curves = analyze_frames(
            floored.watch(frames) if by_pixels else frames,
            video, display, self.model, self.factors, self.provenance, self.effort, checkpoints,
        )  # fmt: skip
        curves = floored.complete(curves) if by_pixels else curves
        return replace(curves, field_of_view=geometry.field_of_view)


def _with_floor(
    keep: Callable[[AnalysedFrames], None], floored: FlooredFrames
) -> Callable[[AnalysedFrames], None]:
    end = 0 if floored.earlier is None else len(floored.earlier)

    def keep_with_floor(part: AnalysedFrames) -> None:
        nonlocal end
        first, end = end, end + part.n_frames
        keep(replace(part, floor=floored.added(first, end)))

    return keep_with_floor
