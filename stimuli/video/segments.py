"""The loss curves of a long video, made in parts by several processes, byte for byte as in one.

Decision (docs/decisions/parts-of-a-video.md): what a frame counts depends on the stretch of sixteen contents
that it lies in, and frames that repeat the one before are no new content. So the parts are first searched for
repetitions; with these known, each part ends where a stretch does.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame, same_pixels
from evenlight.data_schema.tracks.loss_curves import ARRAY_SHAPES, LossCurves
from evenlight.method.contrast.frame_losses import LONGEST_STRETCH
from evenlight.stimuli.video.video_analysis import VideoAnalysis
from evenlight.stimuli.video.video_file import VideoFile
from evenlight.stimuli.video.video_source import VideoSource, closing_frames
from evenlight.stimuli.video.viewing_geometry import seen_video


@dataclass(frozen=True, slots=True)
class SeenVideo:
    """A video file as it is seen on a display.

    Attributes
    ----------
    source, display : VideoFile, Display
        The video, and what shows it.
    field_of_view : float or None
        What its width spans [deg]; None: it is shown pixel for pixel.
    shape : (int, int)
        Height and width of its first frame, and so of all.
    """

    source: VideoFile
    display: Display
    field_of_view: float | None
    shape: tuple[int, int]

    def frames(self, numbers: range) -> Iterator[Frame]:
        """Yield frames of rising numbers; raise `InputError` if one has another size than the first."""
        for number, frame in zip(numbers, self.source.frames_at(numbers), strict=False):
            if frame.shape != self.shape:
                raise InputError(
                    f"{self.source.path} changes its size at frame {number} to {frame.shape[1]}x"
                    f"{frame.shape[0]}; all frames of a video must be of one size"
                )
            yield frame


def parts_of(source: VideoSource, seconds: float) -> list[range]:
    """Return the frames of a video's parts, about so long; one part where it is not to be divided.

    A part begins after a key frame, so that little is decoded twice; of a video whose frames cannot be sought
    all frames are one part.
    """
    n_frames = source.n_frames or 0
    if not isinstance(source, VideoFile) or source.stamps is None or n_frames < 2 * LONGEST_STRETCH:
        return [range(n_frames)]
    times = source.timeline.times[source.timeline.durations > 0]
    wanted = np.arange(seconds, float(times[-1]) - seconds / 2, seconds)
    first = np.searchsorted(times, wanted)
    keys = source.key_frames
    if len(keys):  # the last one up to there
        first = keys[np.searchsorted(keys, first, side="right") - 1] + 1
    begins = [0, *np.unique(first[(first > 1) & (first < n_frames)]).tolist()]
    return [range(a, b) for a, b in zip(begins, [*begins[1:], n_frames], strict=True)]


def new_contents(video: SeenVideo, part: range) -> NDArray[np.bool_]:
    """Return which frames of a part show another content than the frame before, (frames,).

    Parameters
    ----------
    video, part : SeenVideo, range
        The video, and numbers of its frames.
    """
    before = part[:1] if part.start == 0 else range(part.start - 1, part.start)
    numbers = range(before.start, part.stop)
    found, last = [], None
    with closing_frames(video.frames(numbers)) as frames:
        shown, _ = seen_video(frames, video.display, video.field_of_view, video.source.name)
        for frame in shown:
            found.append(last is None or not same_pixels(last, frame.pixels))
            # Planes are the decoder's, and stay; an array may be filled again.
            last = frame.pixels.copy() if isinstance(frame.pixels, np.ndarray) else frame.pixels
    return np.array(found[len(numbers) - len(part) :])


def begins_of(parts: Sequence[range], new: Sequence[NDArray[np.bool_]]) -> list[int]:
    """Return the frame at which the analysis of each part begins, and after them the number of all frames.

    It is the first from the part's beginning on at which a stretch begins: a new content, whose number is a
    multiple of sixteen.

    >>> every = [np.ones(20, bool), np.ones(20, bool)]
    >>> begins_of([range(20), range(20, 40)], every)
    [0, 32, 40]
    """
    is_new = np.concatenate(new)
    contents = np.cumsum(is_new) - 1
    starts = np.flatnonzero(is_new & (contents % LONGEST_STRETCH == 0))
    at = np.searchsorted(starts, [part.start for part in parts])
    return [*np.append(starts, len(is_new))[at].tolist(), len(is_new)]


def curves_of_part(video: SeenVideo, analysis: VideoAnalysis, begin: int, end: int) -> LossCurves | None:
    """Return the loss curves of the frames from one to before another; None if there are none between them.

    Parameters
    ----------
    video, analysis : SeenVideo, VideoAnalysis
        The video, and how its curves are computed.
    begin, end : int
        Of `begins_of`: the frame at the end closes the last stretch, unless the video is over.
    """
    if begin == end:
        return None
    name, count = video.source.name, end - begin
    numbers = range(begin, min(end + 1, video.source.n_frames))
    with closing_frames(video.frames(numbers)) as frames:
        shown, geometry = seen_video(frames, video.display, video.field_of_view, name)
        curves = analysis.curves(shown, geometry, name)
    return replace(curves, **{key: getattr(curves, key)[:count] for key in OF_FRAMES})


OF_FRAMES = tuple(name for name, axes in ARRAY_SHAPES.items() if axes[0] == "N")


def joined(parts: Sequence[LossCurves | None]) -> LossCurves:
    """Return the loss curves of a video from those of its parts, in order.

    Raises
    ------
    InputError
        If there is none.
    """
    some = [part for part in parts if part is not None]
    if not some:
        raise InputError("the video holds no frame; at least one is needed")
    whole: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in some]) for name in OF_FRAMES
    }
    return replace(some[0], **whole)
