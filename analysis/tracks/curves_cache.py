"""Loss curves of videos in the user's cache, under the SHA-256 of all that they depend on.

Decision (docs/decisions/curve-cache.md): a later run finds them, and one that was interrupted goes on after
the last minute that is there. What is damaged counts as not there; where nothing can be written, nothing is.
Runs that do the same at once write the same bytes, whole or not at all: they need not wait for each other.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import ClassVar, Self

import numpy as np

from evenlight.data_schema import contrast_model
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.mapping import sha256_of_record
from evenlight.data_schema.storage.whole_files import write_whole
from evenlight.data_schema.tracks.loss_curves import (
    UNREADABLE,
    LossCurves,
    read_loss_curves,
    write_loss_curves,
)
from evenlight.method.contrast import checkpoints
from evenlight.method.contrast.checkpoints import AnalysedFrames
from evenlight.stimuli.scenes.engine.array_cache import cache_folder
from evenlight.stimuli.video import video_analysis
from evenlight.stimuli.video.video_analysis import VideoAnalysis
from evenlight.stimuli.video.video_source import VideoSource, film_reading
from evenlight.stimuli.video.viewing_geometry import ViewingGeometry

MOST = "EVENLIGHT_CURVES_CACHE_MB"  # what all of it may take, in the environment; 0 for none
STANDARD_MOST = "2000"  # [MB]
PICTURE = ".picture"  # of the file of a player page's picture
# What turns a video into loss curves.
_METHOD = Path(checkpoints.__file__).parents[1]
SOURCES = (
    Path(contrast_model.__file__).parent,
    _METHOD,
    *(_METHOD / name for name in ("contrast", "gpu", "shaders")),
    Path(video_analysis.__file__).parent,
)


@cache
def source_sha256(folders: tuple[Path, ...]) -> str:
    """Return the SHA-256 of the source code in folders."""
    digest = hashlib.sha256()
    for folder in folders:
        for file in sorted(folder.iterdir()):
            if file.suffix in (".py", ".glsl"):
                digest.update(f"{folder.name}/{file.name}\0".encode() + file.read_bytes())
    return digest.hexdigest()


def most_bytes() -> float:
    """Return how much curves may take in the cache [bytes].

    Raises
    ------
    InputError
        If the environment asks for what is no number from 0 on.
    """
    words = os.environ.get(MOST) or STANDARD_MOST
    with suppress(ValueError):
        if (megabytes := float(words)) >= 0:
            return 1e6 * megabytes
    raise InputError(
        f"{MOST} is {words!r}: give the megabytes that loss curves may take in the cache, or 0 for none"
    )


def cache_of(
    analysis: VideoAnalysis,
    source: VideoSource,
    first: Frame,
    geometry: ViewingGeometry,
    say: Callable[[str], None],
) -> CurvesCache | None:
    """Return the place of a video's curves in the user's cache; None where none are kept.

    Parameters
    ----------
    analysis : VideoAnalysis
        What makes them; the video's SHA-256 is that of its provenance.
    source, first, geometry : VideoSource, Frame, ViewingGeometry
        The video, its first frame, and how it is seen.
    say : function of str
        Tells the user why nothing is kept.
    """
    made = analysis.provenance
    if made is None or made.inputs.get("video", "unknown") == "unknown":
        return None
    made_of: dict[str, object] = {
        "video": made.inputs["video"],
        "frames": [source.n_frames, first.time, first.duration],  # a folder of images has any frame rate
        "display": sha256_of_record(geometry.display),
        "sizes": [geometry.size, geometry.shown_size],
        "contrast_model": sha256_of_record(analysis.model),
        "factors": analysis.factors.tolist(),
        "actuator": analysis.actuator.value,
        "device": analysis.effort.device.value,
        "versions": made.versions,
    }
    return CurvesCache.of(source, made_of, say)


@dataclass(slots=True)
class CurvesCache:
    """The place of one video's curves.

    Attributes
    ----------
    folder, key : Path, str
        Where they lie, and the SHA-256 of what they depend on.
    say : function of str
        Tells the user, once, why nothing is kept.
    sources : tuple of Path
        Folders of source code that they depend on.
    """

    sources: ClassVar[tuple[Path, ...]] = SOURCES
    folder: Path
    key: str
    say: Callable[[str], None]
    _parts: int = field(default=0, init=False)  # that are there
    _refused: bool = field(default=False, init=False)  # whether something could not be written

    @classmethod
    def of(cls, source: VideoSource, made_of: dict[str, object], say: Callable[[str], None]) -> Self | None:
        """Return the place of what depends on how a video is read and on values of these names.

        None where nothing is kept.
        """
        if not most_bytes():
            return None
        film = film_reading(source)
        made_of["film"] = [] if film is None else [film.stream, film.damaged.value]
        content = json.dumps({**made_of, "source": source_sha256(cls.sources)}, sort_keys=True)
        return cls(cache_folder() / "curves", hashlib.sha256(content.encode()).hexdigest(), say)

    def read(self) -> LossCurves | None:
        """Return the curves; None if they are not there."""
        path = self.folder / f"{self.key}.npz"
        with suppress(InputError):
            curves = read_loss_curves(path)
            used_now(path)
            return curves
        return None

    def store(self, curves: LossCurves) -> None:
        """Store the curves, instead of their parts."""
        self._write(lambda: write_loss_curves(self.folder / f"{self.key}.npz", curves))
        if not self._refused:
            with suppress(OSError):
                for part in self.folder.glob(f"{self.key}.part-*"):
                    part.unlink(missing_ok=True)

    def begun(self) -> AnalysedFrames | None:
        """Return the frames of all parts before the first that is not there, or does not go on with them."""
        parts: list[AnalysedFrames] = []
        while (part := _read_part(self._part(len(parts)))) is not None:
            if parts and not _goes_on(parts[-1], part):
                break
            parts.append(part)
        self._parts = len(parts)
        if not parts:
            return None
        names = [name for name in AnalysedFrames.__slots__ if getattr(parts[0], name) is not None]
        return AnalysedFrames(
            **{name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
        )

    def keep(self, part: AnalysedFrames) -> None:
        """Store the part that follows."""
        arrays = {name: getattr(part, name) for name in AnalysedFrames.__slots__}
        stream = io.BytesIO()
        np.savez(stream, **{name: array for name, array in arrays.items() if array is not None})
        self._write(lambda: write_whole(self._part(self._parts), stream.getvalue()))
        self._parts += 1

    def _part(self, number: int) -> Path:
        return self.folder / f"{self.key}.part-{number:05d}"

    def _write(self, write: Callable[[], None]) -> None:
        if self._refused:
            return
        try:
            write()
            self._trim()
        except (InputError, OSError) as error:
            self._refused = True
            self.say(f"loss curves are not kept for later runs: {error}")

    def _trim(self) -> None:
        """Delete what was not used for longest, until the rest is within the bound; pictures before curves.

        A picture is made in less time.
        """
        found = []
        for path in self.folder.iterdir():
            with suppress(FileNotFoundError):  # another run has deleted it
                state = path.stat()
                found.append((path.suffix != PICTURE, state.st_mtime_ns, state.st_size, path))
        too_much = sum(size for _, _, size, _ in found) - most_bytes()
        for _, _, size, path in sorted(found):
            if too_much <= 0:
                return
            path.unlink(missing_ok=True)
            too_much -= size


def used_now(path: Path) -> None:
    """Note that a file is used now: it is not the next to go."""
    with suppress(OSError):
        os.utime(path)


def _goes_on(last: AnalysedFrames, part: AnalysedFrames) -> bool:
    follows = part.shown[0] == last.shown[-1] + 1 and part.times[0] > last.times[-1]
    floors = [None if floor is None else floor.shape[1] for floor in (last.floor, part.floor)]
    return bool(follows and part.rows.shape[1] == last.rows.shape[1] and floors[0] == floors[1])


def _read_part(path: Path) -> AnalysedFrames | None:
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            return AnalysedFrames(**arrays)
    except UNREADABLE:
        return None
