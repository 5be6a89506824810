"""The stimuli of a viewing experiment: a folder for each sequence, with its track and its video.

Each is what `evenlight optimize SEQUENCE --out STIMULI/NAME` writes; where videos are shown, with the video
beside it, `video.mkv`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import sha256_of_file
from evenlight.data_schema.recordings.viewing import Stimulus, Version
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.data_schema.tracks.brightness_track import (
    BrightnessTrack,
    read_track,
    require_display_of,
    require_light_of,
)
from evenlight.data_schema.tracks.loss_curves import LossCurves, read_loss_curves
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary
from evenlight.experiments.playback.headset_picture import NARROWEST, WIDEST
from evenlight.experiments.playback.screen_geometry import SAME_ANGLE, ScreenGeometry
from evenlight.stimuli.dimmed.track_fit import require_fit
from evenlight.stimuli.rings.ring_scene import ring_places, search_sha256
from evenlight.stimuli.scenes.content.catalogue import files_sha256, path_named
from evenlight.stimuli.sequence_format import FIELD_OF_VIEW
from evenlight.stimuli.sequences import open_video
from evenlight.stimuli.video.video_source import VideoSource, field_of_view_of, size_of
from evenlight.stimuli.video.viewing_geometry import field_of_view_on

TRACK, SUMMARY, CURVES = "track.csv", "summary.json", "loss_curves.npz"
DARKEST_NEUTRAL = 1.0  # [cd/m^2] below it nobody reads a page
VIDEO_SUFFIXES = (".mkv", ".mp4", ".mov", ".avi", ".webm")


@dataclass(frozen=True, slots=True, eq=False)
class LoadedStimulus:
    """A sequence with its track."""

    stimulus: Stimulus  # what it is, for the manifest
    folder: Path  # where it lies
    track: BrightnessTrack  # its brightness track
    video: VideoSource | None = None  # the video, where one is shown
    geometry: ScreenGeometry | None = None  # how it is seen

    @property
    def name(self) -> str:
        """Name of the sequence."""
        return self.stimulus.name

    @property
    def path(self) -> str:
        """Its camera path, for a search: the file beside its folder if there is one, else a built-in one."""
        return _path_beside(self.folder, self.name)

    def factors(self, version: Version) -> NDArray[np.float64]:
        """Return the brightness factor of each frame in a version, (N,)."""
        if version is Version.OURS:
            return np.asarray(self.track.factors)
        return np.full(len(self.track.factors), self.stimulus.baseline_factor)

    def mean_factor(self, version: Version) -> float:
        """Return the mean brightness factor of a version."""
        stimulus = self.stimulus
        return stimulus.mean_factor if version is Version.OURS else stimulus.baseline_factor

    def curves(self) -> LossCurves:
        """Return its loss curves; raise `InputError` if they are not there."""
        return read_loss_curves(self.folder / CURVES)


def load_stimuli(
    folder: Path, names: Sequence[str], display: Display, *, with_video: bool
) -> tuple[LoadedStimulus, ...]:
    """Return some sequences of a folder of stimuli.

    Parameters
    ----------
    folder : Path
        With a folder for each sequence.
    names : sequence of str
        Which sequences.
    display : Display
        What they are shown on; a track that was made for another, or for another angle, is refused.
    with_video : bool
        Whether their videos are shown; without, they need not be there.

    Raises
    ------
    InputError
        If one is missing, was made for another display or angle, or track and video do not fit.
    """
    if not folder.is_dir():
        raise InputError(
            f"{folder}: no such folder of stimuli; make one with `evenlight optimize {names[0]} --budget 0.5 "
            f"--out {folder / names[0]}`"
        )
    return tuple(_stimulus(folder / name, name, display, with_video) for name in names)


def track_display(folder: Path, names: Sequence[str]) -> Display | None:
    """Return the display that the first sequence's track was made for; None where there is no such track."""
    track = folder / names[0] / TRACK
    return read_track(track).header.display if track.is_file() else None


def require_flat_screens(stimuli: Sequence[LoadedStimulus]) -> None:
    """Refuse a video that no flat screen in a headset is wide enough for, as it is seen there."""
    for each in stimuli:
        if each.geometry is None:
            continue
        geometry = each.geometry
        width = field_of_view_on(geometry.display, round(geometry.size[0] * (geometry.scale or 1.0)))
        if not NARROWEST <= width <= WIDEST:
            raise InputError(
                f"{each.folder}: its video would be {width:.4g} degrees wide, and a flat screen in a headset "
                f"is {NARROWEST:g} to {WIDEST:g}: make its track again with a --field-of-view of as many"
            )


def as_searched(stimuli: Sequence[LoadedStimulus]) -> tuple[LoadedStimulus, ...]:
    """Return sequences that are searched: no video is shown of them, but the scenes along their paths.

    Raises
    ------
    InputError
        If one is no path with places of rings, or its track was made for another angle than the
        built-in sequence or the video beside it was rendered for.
    """
    for each in stimuli:
        ring_places(each.path)
        _require_true_size(each)
        made_of = each.track.header.provenance.inputs.get("path")
        if each.path.endswith(".json") and made_of not in (None, files_sha256(path_named(each.path))):
            raise InputError(
                f"{each.folder}: its track was made when {each.path} or its scene was another; make it again "
                f"with `evenlight optimize {each.path} --budget B --out {each.folder}`"
            )
    return tuple(
        replace(each, stimulus=replace(each.stimulus, video_sha256=search_sha256(each.path)))
        for each in stimuli
    )


def neutral_luminance(stimuli: Sequence[LoadedStimulus]) -> float:
    """Return a luminance for pages and uniform fields: the geometric mean of all frames as they are shown.

    What adapts the eye before a video is neither its first frame nor the brightness of either version
    [cd/m^2].
    """
    frames = np.concatenate([stimulus.track.mean_luminance for stimulus in stimuli])
    return float(np.exp(np.mean(np.log(np.maximum(frames, DARKEST_NEUTRAL)))))


def _path_beside(folder: Path, name: str) -> str:
    own = folder.parent / f"{name}.json"
    return str(own) if own.is_file() else name


def _stimulus(folder: Path, name: str, display: Display, with_video: bool) -> LoadedStimulus:
    if not (folder / TRACK).is_file():
        raise InputError(
            f"{folder / TRACK}: no such file; make it with `evenlight optimize {_path_beside(folder, name)} "
            "--budget B --out "
            f"{folder}`"
        )
    track = read_track(folder / TRACK)
    summary = read_json_record(OptimizationSummary, folder / SUMMARY)
    try:
        require_display_of(
            track.header, display, "FILE", ", FILE being the one that the rig names as its display"
        )
    except InputError as error:
        raise InputError(f"{folder / TRACK}: {error}") from error
    require_light_of(track, display, folder / TRACK)
    path = _video_file(folder, name) if with_video else None
    video = open_video(str(path)) if path is not None else None
    geometry = None
    if video is not None:
        geometry = ScreenGeometry.of(video, size_of(video), display, track.header)
        try:
            require_fit(video, track)
            geometry.require_as_analysed()
        except InputError as error:
            raise InputError(f"{folder}: {error}") from error
    digest = sha256_of_file(path) if path is not None else ""
    if digest and track.header.provenance.inputs.get("video", digest) != digest:
        # The same walk in another size has its details elsewhere on the visual field, and another loss.
        raise InputError(
            f"{folder}: the track was made from another video than {path and path.name}, or from the same in "
            f"another size; make it with `evenlight optimize {path} --budget B --out {folder}`"
        )
    stimulus = Stimulus(
        name=name,
        video_sha256=digest,
        track_sha256=sha256_of_file(folder / TRACK),
        frames=len(track.factors),
        duration=summary.duration,
        mean_factor=summary.mean_factor,
        baseline_factor=summary.baseline_factor,
        pixels_per_degree=None if geometry is None else geometry.pixels_per_degree,
    )
    return LoadedStimulus(stimulus, folder, track, video, geometry)


def _require_true_size(searched: LoadedStimulus) -> None:
    """Refuse the track of a path that was not analysed at true size: a search shows the scene so."""
    folder, analysed = searched.folder, searched.track.header.field_of_view
    rendered = (field_of_view_of(open_video(str(path))) for path in _videos(folder))
    angles = (FIELD_OF_VIEW, *(angle for angle in rendered if angle is not None))
    if analysed is None or all(abs(analysed / angle - 1) > SAME_ANGLE for angle in angles):
        made = "pixel for pixel" if analysed is None else f"at {analysed:.4g}°"
        raise InputError(
            f"{folder}: the track was made {made}, and the search shows the path at its true size, "
            f"{' or '.join(f'{angle:.4g}°' for angle in angles)} wide; make it again with `evenlight "
            f"optimize {searched.path} --budget B --out {folder}`, without --field-of-view"
        )


def _videos(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if path.suffix.lower() in VIDEO_SUFFIXES)


def _video_file(folder: Path, name: str) -> Path:
    found = _videos(folder)
    if not found:
        raise InputError(
            f"{folder}: holds no video; render it with `evenlight render {name} --out "
            f"{folder}/video.mkv`, "
            "or put the video of the track there"
        )
    if len(found) > 1:
        names = ", ".join(path.name for path in found)
        raise InputError(f"{folder}: expected one video, got {len(found)} ({names}); take the others away")
    return found[0]
