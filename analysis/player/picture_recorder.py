"""Where the picture of a player page comes from: frames that an analysis reads, the cache, the video."""

from __future__ import annotations

import dataclasses
import io
import itertools
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.player.proxy_video import (
    Proxy,
    ProxyEncoder,
    StillsEncoder,
    Tiles,
    in_background,
    picture_format,
)
from evenlight.analysis.tracks.curves_cache import PICTURE, CurvesCache, used_now
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.storage.whole_files import write_whole
from evenlight.data_schema.tracks.loss_curves import UNREADABLE, LossCurves
from evenlight.progress import counted, shown_progress
from evenlight.stimuli.video import video_file
from evenlight.stimuli.video.video_file import VideoFile
from evenlight.stimuli.video.video_source import VideoSource, closing_frames, frames_at

Picture = Proxy | Tiles
ASSUMED_FRAMES = 100_000  # of a video that does not tell how many it has


class PictureRecorder:
    """Makes the picture of a video's player page while its frames stream past, or later.

    If `cached`, pictures are looked for in the user's cache, and kept there.
    """

    def __init__(self, source: VideoSource, *, cached: bool, quiet: bool) -> None:
        self.source, self._cached, self._quiet = source, cached, quiet
        self._picture: Picture | None = None

    def watch(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """Yield all frames of the video unchanged, and encode them meanwhile, in another thread."""
        passing = iter(frames)
        first = next(passing)
        encoder = self._encoder(first)
        with in_background(encoder.add) as add:
            for number, frame in enumerate(itertools.chain([first], passing)):
                if number % encoder.form.stride == 0:
                    add(number, frame)
                yield frame
        self._picture = encoder.finished()

    def picture(self, curves: LossCurves) -> Picture:
        """Return the picture: of the frames that were watched, from the cache, or of the video read anew."""
        cache = self._cache(curves)
        if self._picture is None and cache is not None and (kept := cache.read_picture()) is not None:
            return kept
        self._picture = self._picture or self._read(curves.n_frames)
        if cache is not None:
            cache.store_picture(self._picture)
        return self._picture

    def _encoder(self, first: Frame) -> ProxyEncoder | StillsEncoder:
        (height, width), n_frames = first.shape, self.source.n_frames or ASSUMED_FRAMES
        seconds = 0.0
        if isinstance(self.source, VideoFile):
            seconds = float(self.source.timeline.durations.sum())
        seconds = seconds or n_frames * first.duration
        form = picture_format((width, height), n_frames, seconds)
        return ProxyEncoder(form, n_frames / seconds) if form.rate else StillsEncoder(form)

    def _read(self, n_frames: int) -> Picture:
        encoder = self._encoder(next(frames_at(self.source, [0])))
        numbers = range(0, n_frames, encoder.form.stride)
        frames = self.source.frames() if encoder.form.rate else frames_at(self.source, numbers)
        words = f"encoding {self.source.name} for its player page"
        with (
            shown_progress(self._quiet) as progress,
            closing_frames(counted(progress, frames, words, len(numbers))) as shown,
            in_background(encoder.add) as add,
        ):
            for number, frame in zip(numbers, shown, strict=False):
                add(number, frame)
        return encoder.finished()

    def _cache(self, curves: LossCurves) -> PictureCache | None:
        video = curves.provenance.inputs.get("video", "unknown")
        if not self._cached or video == "unknown":
            return None
        made_of: dict[str, object] = {
            "picture of": video,
            "frames": [curves.n_frames, float(curves.durations[0])],  # a folder of images has any frame rate
            "encoder": [av.__version__, "libx264" in av.codecs_available],
        }
        return PictureCache.of(self.source, made_of, lambda words: None)  # what is wrong is said of curves


class PictureCache(CurvesCache):
    """The place of a picture beside loss curves, within the same bound."""

    sources = (Path(video_file.__file__).parent, Path(__file__).parent)

    def read_picture(self) -> Picture | None:
        """Return the picture; None if there is none that can be read."""
        try:
            with self._path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
                held = {name: _plain(name, arrays[name]) for name in arrays.files}
            used_now(self._path)
            return Proxy(**held) if "times" in held else Tiles(**held)
        except UNREADABLE:
            return None

    def store_picture(self, picture: Picture) -> None:
        """Keep the picture."""
        held = {field.name: getattr(picture, field.name) for field in dataclasses.fields(picture)}
        stream = io.BytesIO()
        np.savez(stream, **{**held, "data": np.frombuffer(picture.data, np.uint8)})
        self._write(lambda: write_whole(self._path, stream.getvalue()))

    @property
    def _path(self) -> Path:
        return self.folder / f"{self.key}{PICTURE}"


def _plain(name: str, array: NDArray[Any]) -> Any:
    """Return a field of a picture as its record has it."""
    if name == "data":
        return array.tobytes()
    return array if array.ndim else array.item()
