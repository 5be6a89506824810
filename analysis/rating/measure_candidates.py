"""What a rating study could tell about the measure of loss: candidates, and what each says of what was shown.

The paper's measure leaves choices free: from which frequency on bands count, which contrast is visible, how
strongly neighbours mask. Beside a grid of these stand the other measures (`method.contrast.measures`). Each
candidate gives every version of every sequence that was rated one number: its loss, pooled over time.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from evenlight.data_schema.arrays import Array
from evenlight.data_schema.contrast_model import DEFAULT_MODEL, ContrastModel
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.provenance import sha256_of_file
from evenlight.data_schema.recordings.viewing import Stimulus, Version
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.data_schema.tracks.brightness_track import read_track
from evenlight.data_schema.tracks.loss_curves import LossCurves, read_loss_curves
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary
from evenlight.method.contrast.measures import MEASURES
from evenlight.method.contrast.one_factor import OneFactorLoss
from evenlight.stimuli.sequences import open_video
from evenlight.stimuli.video.video_source import VideoSource
from evenlight.stimuli.video.viewing_geometry import seen_video

LOWEST_FREQUENCIES = (0.5, 1.0, 2.0, 4.0)  # [cpd]
THRESHOLDS = (0.5, 1.0, 2.0)  # multiples of the contrast that the CSF says
MASKING_STRENGTHS = (0.0, 1.0, 2.0)
# Exponents of the mean over time: 1 is the plain mean; with 4 the worst moments count most (Quick 1974).
POOLING = (1.0, 4.0)
SAMPLED_FRAMES = 30  # of each video
VIDEO_SUFFIXES = (".mkv", ".mp4", ".mov", ".avi", ".webm")

Condition = tuple[str, Version]  # of a sequence, how it was dimmed


@dataclass(frozen=True, slots=True)
class MeasureCandidate:
    """A measure of what dimming loses.

    Attributes
    ----------
    name : str
        Of one of the named measures; "" for one of the grid.
    model : ContrastModel
        Its choices.
    pooling : float
        Exponent of the mean over time.
    """

    name: str
    model: ContrastModel
    pooling: float

    @property
    def words(self) -> str:
        """What sets it apart."""
        own = self.model
        choices = f"from {own.lowest_frequency:g} cpd, threshold × {own.threshold:g}"
        words = self.name or f"{choices}, masking × {own.masking_strength:g}"
        return words if self.pooling == 1 else f"{words}; worst moments"


def measure_candidates() -> tuple[MeasureCandidate, ...]:
    """Return all candidates, the paper's measure with the plain mean over time first."""
    grid = itertools.product(LOWEST_FREQUENCIES, THRESHOLDS, MASKING_STRENGTHS)
    varied = [
        ContrastModel(lowest_frequency=lowest, threshold=threshold, masking_strength=masking)
        for lowest, threshold, masking in grid
    ]
    named = [*MEASURES.items(), *(("", model) for model in varied if model != DEFAULT_MODEL)]
    return tuple(MeasureCandidate(name, model, power) for power in POOLING for name, model in named)


def pooled(losses: Array, exponent: float) -> float:
    """Return the mean over time of the losses of frames, (N,), by an exponent.

    >>> pooled(np.array([0.0, 1.0]), 1.0)
    0.5
    """
    return float(np.mean(losses**exponent) ** (1 / exponent))


@dataclass(frozen=True, slots=True)
class RatedStimulus:
    """A sequence that was rated: its video, and the factors of both versions.

    Attributes
    ----------
    video : VideoSource
        Undimmed.
    curves : LossCurves
        Those that its track was made of: display and geometry.
    factors : dict of Version to array (N,)
        b of each frame.
    """

    video: VideoSource
    curves: LossCurves
    factors: Mapping[Version, Array]

    def sampled(self) -> Iterator[tuple[int, Frame]]:
        """Yield some of its frames as they are seen, evenly spread, with their numbers."""
        every = max(self.curves.n_frames // SAMPLED_FRAMES, 1)
        frames, _ = seen_video(
            self.video.frames(), self.curves.display, self.curves.field_of_view, self.video.name
        )
        for number, frame in enumerate(frames):
            if number % every == every // 2:
                yield number, frame

    def losses(self, models: Sequence[ContrastModel]) -> dict[Version, Array]:
        """Return what each version loses of sampled frames, by each model, (models, frames)."""
        lowest = float(min(factors.min() for factors in self.factors.values()))
        rows: dict[Version, list[list[float]]] = {version: [] for version in Version}
        measures: list[OneFactorLoss] = []
        for number, frame in self.sampled():
            pixels = frame.pixel_values
            if not measures:
                shape = (pixels.shape[0], pixels.shape[1])
                measures = [OneFactorLoss(shape, self.curves.display, model, lowest) for model in models]
            for version, factors in self.factors.items():
                rows[version].append([one.of(pixels, float(factors[number])).loss for one in measures])
        return {version: np.array(table).T for version, table in rows.items()}


def rated_stimuli(folder: Path, shown: Mapping[str, Stimulus | None]) -> dict[str, RatedStimulus]:
    """Return the sequences of a folder of stimuli that were rated.

    Parameters
    ----------
    folder : Path
        With a folder for each sequence: its video, and what `evenlight optimize` wrote.
    shown : mapping of str to Stimulus or None
        Their names, and what the sessions say that they showed; None where they do not.

    Raises
    ------
    InputError
        If something is missing, or is not what was shown.
    """
    missing = [name for name in shown if not (folder / name).is_dir()]
    if missing:
        raise InputError(
            f"{folder}: holds no folder {', '.join(missing)}; give the folder of the rated stimuli, "
            "with one for each sequence: its video, and what `evenlight optimize` wrote"
        )
    return {name: _rated_stimulus(folder / name, stimulus) for name, stimulus in shown.items()}


def _rated_stimulus(folder: Path, shown: Stimulus | None) -> RatedStimulus:
    """Return the sequence in a folder."""
    track = read_track(folder / "track.csv")
    curves = read_loss_curves(folder / "loss_curves.npz")
    summary = read_json_record(OptimizationSummary, folder / "summary.json")
    files = sorted(path for path in folder.iterdir() if path.suffix in VIDEO_SUFFIXES)
    if len(files) != 1:
        raise InputError(f"{folder}: expected the one video that was rated, found {len(files)}")
    if shown is not None:
        for path, sha256 in ((folder / "track.csv", shown.track_sha256), (files[0], shown.video_sha256)):
            if sha256 and sha256_of_file(path) != sha256:
                raise InputError(f"{path}: is not what the sessions showed (SHA-256); give that one")
    video = open_video(str(files[0]))
    if not video.n_frames == len(track.factors) == curves.n_frames:
        raise InputError(
            f"{folder}: the video has {video.n_frames} frames, the track {len(track.factors)}, the loss "
            f"curves {curves.n_frames}; make them with one run of `evenlight optimize`"
        )
    constant = np.full(len(track.factors), shown.baseline_factor if shown else summary.baseline_factor)
    return RatedStimulus(video, curves, {Version.OURS: track.factors, Version.BASELINE: constant})


def condition_losses(
    stimuli: Mapping[str, RatedStimulus], candidates: Sequence[MeasureCandidate]
) -> dict[Condition, Array]:
    """Return what each candidate says that each version of each sequence loses, (candidates,) each."""
    models = list(dict.fromkeys(candidate.model for candidate in candidates))
    place = {model: k for k, model in enumerate(models)}
    found = {}
    for name, stimulus in stimuli.items():
        for version, table in stimulus.losses(models).items():
            found[name, version] = np.array([pooled(table[place[c.model]], c.pooling) for c in candidates])
    return found
