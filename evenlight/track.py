"""From a video and a budget to a brightness track, as an object that answers questions."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenlight.analysis.figure_style import write_figure
from evenlight.analysis.report import KeyFigure
from evenlight.analysis.results import Result
from evenlight.analysis.tracks.first_page import key_figures, told, verdict
from evenlight.analysis.tracks.optimization import optimize_video
from evenlight.analysis.tracks.optimization_job import AnalysedVideo
from evenlight.analysis.tracks.track_figure import DrawnTrack, track_figure
from evenlight.analysis.tracks.track_request import TrackRequest
from evenlight.analysis.tracks.track_results import CURVES, SUMMARY, TRACK, write_track_files
from evenlight.data_schema.arguments import choice, number, numbers, path
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.errors import ArgumentError, InputError
from evenlight.data_schema.mapping import sha256_of_record
from evenlight.data_schema.storage.text_files import read_json_record, read_toml, write_json_record
from evenlight.data_schema.storage.whole_files import require_free
from evenlight.data_schema.tracks.brightness_track import (
    BrightnessTrack,
    read_track,
    require_written_with,
    track_columns,
    write_track,
)
from evenlight.data_schema.tracks.film_reading import Damaged
from evenlight.data_schema.tracks.loaded_track import load_track
from evenlight.data_schema.tracks.loss_curves import (
    LossCurves,
    read_loss_curves,
    require_possible_curves,
)
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary
from evenlight.keywords import takes_fields_of
from evenlight.method.contrast.curve_lookup import loss_at
from evenlight.method.preset_files import (
    load_contrast_model,
    load_display,
    load_power_model,
    load_rate_limit,
)
from evenlight.progress import shown_progress
from evenlight.stimuli.dimmed.apply_options import (
    AppliedVersion,
    Codec,
    DimmedFile,
    DimmedVersion,
    ExportFormat,
)
from evenlight.stimuli.dimmed.apply_video import apply_track
from evenlight.stimuli.dimmed.dimming import pixel_scale
from evenlight.stimuli.dimmed.encoders import codec_for
from evenlight.stimuli.dimmed.matched_track import display_of, match_track
from evenlight.stimuli.dimmed.track_export import exported_track, write_export
from evenlight.stimuli.video.frames_in_memory import Frames, Named, frame_of, video_of
from evenlight.stimuli.video.video_source import VideoSource

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

FIGURE = "track.png"


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Track(Result):
    """A brightness track: what `optimize` returns and `load` reads.

    Attributes
    ----------
    track : BrightnessTrack
        The columns of `track.csv`, as arrays.
    outcome : OptimizationSummary
        The keys of `summary.json`: budget, objective, bound, rates, power, how it was made.
    curves : LossCurves
        Contrast loss of every frame at every brightness factor.
    others : tuple of Track
        Those of the clips that share its budget; the outcome of each is about that clip.
    """

    track: BrightnessTrack
    outcome: OptimizationSummary
    curves: LossCurves
    others: tuple[Track, ...] = ()

    @property
    def heading(self) -> str:
        """What it is, in a few words."""
        s = self.outcome
        return f"Track of {s.video!r}: {s.frames} frames, {s.duration:.4g} s, mean factor {s.mean_factor:.3f}"

    @property
    def first_lines(self) -> tuple[str, tuple[KeyFigure, ...]]:
        """Whether it is worth it, and the key figures: its first page."""
        return verdict(self.outcome), key_figures(self.outcome)

    def __str__(self) -> str:
        return "\n".join(told(self.outcome))  # as `evenlight optimize` says it

    def __len__(self) -> int:
        return len(self.track.factors)

    @property
    def factors(self) -> Array:
        """b, the brightness factor of each frame, (N,)."""
        return self.track.factors

    @property
    def times(self) -> Array:
        """When each frame appears [s], (N,)."""
        return self.track.times

    @property
    def baseline(self) -> float:
        """The factor of constant dimming at equal power."""
        return self.outcome.baseline_factor

    @property
    def objective(self) -> float:
        """Mean absolute difference of contrast loss between two frames (Eq. 6)."""
        return self.outcome.objective

    @property
    def objective_baseline(self) -> float:
        """The same, of constant dimming at equal power."""
        return self.outcome.objective_baseline

    @property
    def gap(self) -> float:
        """Share of what was minimized that a better track could gain at most, in [0, 1]; 1: not certified."""
        value, bound = self.objective, self.outcome.lower_bound
        if (minimized := self.outcome.minimized) is not None:
            value, bound = minimized.value, minimized.bound
        return float(1 - bound / value) if value > 0 else 0.0

    def loss(self, factors: ArrayLike | None = None) -> Array:
        """Return the contrast loss 𝓛_c of each frame, (N,).

        Parameters
        ----------
        factors : float or array_like, (N,), optional
            Brightness factors to compute it at, in [lowest factor, 1]; else those of the track.

        Examples
        --------
        `track.loss(track.baseline)` is the loss under constant dimming at equal power.
        """
        if factors is None:
            return self.track.contrast_loss
        return loss_at(self.curves, _checked_factors(factors, self.curves))

    def power(self) -> Array | None:
        """Return the power of the display in each frame [W], (N,); None without a power model."""
        return self.track.power

    def __iter__(self) -> Iterator[tuple[float, float]]:
        """Yield when each frame appears [s], and its factor."""
        return iter(zip(self.times.tolist(), self.factors.tolist(), strict=True))

    def factor_at(self, times: ArrayLike) -> Array:
        """Return b of the frames that are shown at times of the video.

        Parameters
        ----------
        times : float or array_like, any shape
            [s]; before the first frame its factor counts, after the last that one's.

        Returns
        -------
        array, shape of times
        """
        asked = numbers("times", times)
        if np.isnan(asked).any():
            raise ArgumentError("times", f"must be numbers, got {times!r}")
        shown = np.searchsorted(self.times, asked, side="right") - 1
        return np.asarray(self.factors[np.maximum(shown, 0)])

    def dim(self, frame: Any, time: float) -> NDArray[Any]:
        """Return a frame as its pixels show it dimmed, gamma-encoded.

        Parameters
        ----------
        frame : array, (height, width, 3), or Frame
            Gamma-encoded R, G, B: uint8 or uint16 over their full range, or floats in [0, 1].
        time : float
            When it is shown [s].

        Returns
        -------
        array, shape and type of the frame
            b^(1/γ) times its pixel values, γ that of the track's display; whole numbers are rounded.

        Raises
        ------
        InputError
            If it is no such array.
        """
        pixels = frame_of(frame).pixel_values
        dimmed = pixels * pixel_scale(self.factor_at(number("time", time)), display_of(self.track).gamma)
        return (np.rint(dimmed) if pixels.dtype.kind == "u" else dimmed).astype(pixels.dtype)

    def apply(
        self,
        video: Named | VideoSource | Frames,
        out: Named,
        *,
        version: AppliedVersion | str = AppliedVersion.OURS,
        codec: Codec | str | None = None,
        fps: float | None = None,
        other_video_ok: bool = False,
        force: bool = False,
    ) -> None:
        """Write the video dimmed by the track to a file, as `evenlight apply` does.

        Parameters
        ----------
        video : str, path, video or frames
            That the track was made of; as in `optimize`.
        out : str or path
            File to write: .mp4, .mov or .mkv.
        version : str, optional
            "ours" (the track), "constant" (constantly at equal power) or "side-by-side".
        codec : str, optional
            "h264", "hevc10", "av1" or "ffv1"; else h264, in .mkv ffv1.
        fps : float, optional
            Frame rate of images, frames in memory or a built-in sequence [Hz].
        other_video_ok : bool, optional
            Whether another video with the same frame times is accepted.
        force : bool, optional
            Whether to replace the file if it exists.

        Raises
        ------
        InputError
            If the video is another one or cannot be read, or the file cannot be written.
        """
        file = path("out", out)
        require_free(file, force=force)
        asked = None if codec is None else choice("codec", codec, Codec)
        made = DimmedFile(file, codec_for(file, asked), choice("version", version, AppliedVersion))
        source = video_of(video, fps)
        with self._written() as folder, shown_progress(True, f"dimming {source.name}", len(self)) as progress:
            apply_track(source, match_track(source, folder, other_video_ok=other_video_ok), made, progress.at)

    def export(
        self,
        to: str,
        out: Named,
        *,
        version: DimmedVersion | str = DimmedVersion.OURS,
        force: bool = False,
    ) -> None:
        """Write the track for another program, as `evenlight track export` does.

        Parameters
        ----------
        to : {"ffmpeg", "mpv", "json"}
            A filter script, a Lua script, or times and factors.
        out : str or path
            File to write.
        version : str, optional
            "ours" (the track) or "constant" (constantly at equal power).
        force : bool, optional
            Whether to replace the file if it exists.

        Raises
        ------
        InputError
            If there is no such program, or the file cannot be written.
        """
        file, program = path("out", out), choice("to", to, ExportFormat).value
        require_free(file, force=force)
        with self._written() as folder:
            loaded, shown = load_track(folder), choice("version", version, DimmedVersion)
            write_export(file, exported_track(loaded, display_of(self.track), shown), program)

    @contextmanager
    def _written(self) -> Iterator[Path]:
        """Write the files that other commands read, into a folder for as long as they do."""
        with tempfile.TemporaryDirectory() as folder:
            write_track(Path(folder) / TRACK, self.track)
            write_json_record(Path(folder) / SUMMARY, self.outcome)
            yield Path(folder)

    def to_frame(self) -> pd.DataFrame:
        """Return the columns of `track.csv`, one row for each frame, as a pandas table."""
        import pandas as pd

        return pd.DataFrame(track_columns(self.track))

    @property
    def figures(self) -> Mapping[str, Figure]:
        """The figure `track.png` without the pictures of frames: factor, loss, rate over time."""
        data = DrawnTrack(self.track, self.outcome, self.loss(self.baseline))
        return {"track": track_figure(data)}

    def write(self, folder: Path) -> None:
        """Write `track.csv`, `track.json`, `summary.json`, `loss_curves.npz` and `track.png`."""
        write_track_files(folder, self.track, self.outcome, self.curves)
        write_figure(folder / FIGURE, self.figures["track"])

    @property
    def made_by(self) -> str:  # type: ignore[override] # one for all of the others
        """Whose results its files are."""
        return "optimize" if self.outcome.control is None else "control"


def _of_toml(file: Path) -> Any:
    known = read_toml(file, "a display or a power model in TOML") if file.is_file() else ()
    return load_power_model(file) if "base_power_w" in known else load_display(file)


OPENED = {".toml": _of_toml, ".json": load_rate_limit, ".npz": read_loss_curves}


def load(folder: Named) -> Any:
    """Return what was saved: a folder's track; a file's display or power model (.toml), limit or curves.

    Raises
    ------
    InputError
        If a file is missing or damaged, or the folder holds another result.
    """
    of = path("folder", folder)
    if of.suffix in OPENED and not of.is_dir():
        return OPENED[of.suffix](of)
    if not of.is_dir():
        raise InputError(
            f"{of}: no such folder; give one that `Track.save` or `evenlight optimize` has written"
        )
    if not (of / TRACK).exists():
        raise InputError(
            f"{of}: holds no track (of several clips, each has a folder in it); of other results read tables "
            "with pandas and rate limits with `load_rate_limit`, or make the result anew of the same data"
        )
    track = Track(
        read_track(of / TRACK),
        read_json_record(OptimizationSummary, of / SUMMARY),
        read_loss_curves(of / CURVES),
    )
    for name in (SUMMARY, CURVES):
        require_written_with(track.track.header, of / name)
    return track


@takes_fields_of(TrackRequest)
def optimize(video: Named | VideoSource | Frames | LossCurves, request: dict[str, Any]) -> Track:
    """Return the brightness track of a video under a power budget (Eq. 6).

    Parameters
    ----------
    video : str, path, video of `open_video`, iterable of frames, or LossCurves
        A file, a folder of images, the name of a built-in sequence; arrays (height, width, 3) of gamma-
        encoded R, G, B (uint8 or uint16 over their full range, floats in [0, 1]) or `Frame` objects; or the
        curves of an earlier analysis, which serve for other budgets, power models and rate limits too.
    {fields}

    Returns
    -------
    Track
        Budget met to 1e-6, no step faster than the rate limit, no worse than constant dimming. Those of other
        clips are its `others`.

    Raises
    ------
    InputError
        If something cannot be used: the message names it and says what would be right.
    """
    known = video if isinstance(video, LossCurves) else None
    asked = TrackRequest(**request)
    if known is not None:
        asked = _of_curves(asked, known)
    asked.check()
    display, posed = asked.posed(known)
    source = AnalysedVideo(known) if known is not None else asked.source(video)
    job = asked.job(source, display, posed)
    effort = asked.effort(display, job.model, quiet=True)
    _, clips = optimize_video(replace(job, effort=effort, cached=False, player=False, quiet=True))
    first, *others = (Track(drawn.track, drawn.summary, curves) for curves, drawn in clips)
    return replace(first, others=tuple(others))


def _of_curves(asked: TrackRequest, known: LossCurves) -> TrackRequest:
    """Return what is asked of loss curves; what they were made with cannot be asked again."""
    require_possible_curves(known)
    lowest = float(known.factors[0])
    own = {
        "display": (None, known.display),
        "min_factor": (0.2, lowest),
        "fps": (None,),
        "damaged": (Damaged.REFUSE, "refuse"),
        "stream": (None,),
        "field_of_view": (None,),
    }
    if names := ", ".join(name for name, taken in own.items() if getattr(asked, name) not in taken):
        raise InputError(f"{names}: loss curves were made with their own; leave this out beside them")
    made_with = known.provenance.inputs.get("contrast_model")
    if made_with not in (None, sha256_of_record(load_contrast_model(asked.contrast_model))):
        raise InputError("contrast_model is not the one that the loss curves were made with; name that one")
    if asked.robust or asked.others:
        raise InputError("loss curves are of one video and one measure: leave out robust and others")
    if asked.actuator not in (None, known.actuator, known.actuator.value):
        raise InputError(f"actuator: the loss curves were made for {known.actuator.value}; leave it out")
    return replace(asked, min_factor=lowest, actuator=known.actuator)


def _checked_factors(factors: ArrayLike, curves: LossCurves) -> Array:
    """Return the factor of each frame, (N,), if the curves reach them."""
    try:
        given = np.broadcast_to(numbers("factors", factors), (curves.n_frames,))
    except InputError:
        raise
    except ValueError:
        raise InputError(
            f"factors must be one number or one for each of the {curves.n_frames} frames"
        ) from None
    lowest = float(curves.factors[0])
    if not (given.min() >= lowest * (1 - 1e-9) and given.max() <= 1):
        raise InputError(f"factors must lie in {lowest:g} to 1, got {given.min():g} to {given.max():g}")
    return given
