"""The container of a film and the stream of its pictures, with what their headers say."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

import av
from av.error import FFmpegError
from av.stream import Disposition

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.input_sizes import MOST_PIXELS, most_allowed
from evenlight.stimuli.sequence_format import NARROWEST, WIDEST
from evenlight.stimuli.video.animated_webp import UNREADABLE, film_of_webp
from evenlight.stimuli.video.film_bytes import FilmBytes
from evenlight.stimuli.video.video_locations import VideoPath

if TYPE_CHECKING:
    from av.container import InputContainer
    from av.video.stream import VideoStream

SUPPORTED = "give a video file that FFmpeg plays, or a folder of images"
ALONE = {"protocol_whitelist": "none"}  # a file opens no other, as playlists do: its SHA-256 is of all
FIELD_OF_VIEW = "FIELD_OF_VIEW"  # tag of the file: the degrees that the width was rendered to span
COVER = Disposition.attached_pic | Disposition.still_image | Disposition.timed_thumbnails


def bounded_pictures() -> dict[str, str]:
    """Return the option with which FFmpeg's decoders refuse pictures that are too large."""
    return {"max_pixels": str(min(most_allowed(MOST_PIXELS), 2**31 - 1))}


def open_alone(content: FilmBytes) -> InputContainer:
    """Open a container of pictures that are not too large, and no file that it names."""
    # The decoders take them too, with which it is looked what the streams are.
    return av.open(content, "r", options=ALONE | bounded_pictures())


@contextmanager
def opened_container(path: VideoPath, content: FilmBytes | None = None) -> Iterator[InputContainer]:
    """Yield an open container of a video, which is closed at the end; read from `content` if that is open.

    All bytes come through `FilmBytes`.
    """
    with ExitStack() as stack:
        content = content or stack.enter_context(FilmBytes(path))
        try:
            container = stack.enter_context(open_alone(content))
        except (FFmpegError, UnicodeError) as error:
            raise InputError(
                f"FFmpeg finds no video in {path} (not a video, a list of others, damaged or cut off); "
                f"{SUPPORTED}"
            ) from error
        if container.format.name == "webp_pipe" and (film := _animation(path, content)) is not None:
            container = stack.enter_context(av.open(film, "r"))
        names = container.format.name.split(",")
        # `tty` draws text files as terminal screens.
        if "tty" in names or all(s.disposition & Disposition.attached_pic for s in container.streams.video):
            raise InputError(f"{path} holds no video; {SUPPORTED}")
        if "image2" in names or container.format.name.endswith("_pipe"):
            raise InputError(f"{path} is one image, not a video; for images give the folder that holds them")
        yield container


def _animation(path: VideoPath, content: FilmBytes) -> io.BytesIO | None:
    content.seek(0)
    try:
        return film_of_webp(path, content.read(content.size))
    except InputError:
        raise
    except UNREADABLE as error:
        raise InputError(f"{path} is a damaged WebP ({error}); give a whole copy of it") from error


def film_stream(path: VideoPath, container: InputContainer, wanted: int | None = None) -> VideoStream:
    """Return the stream of the film, with a decoder for it.

    That is the one wanted; else of those that move those that are flagged as default, of these the largest,
    and the first of these. A cover or a still is the film only where there is nothing else. Only where there
    is a choice, packets are read to tell what moves.

    Raises
    ------
    InputError
        If there is no such stream, or no decoder for it.
    """
    streams = [s for s in container.streams.video if wanted in (None, s.index)]
    if not streams:
        known = [s.index for s in container.streams.video]
        raise InputError(f"`stream` {wanted}: {path} has the videos {known}")
    films = [s for s in streams if not s.disposition & COVER] or streams
    if len(films) > 1:
        moving = _moving(path, [s.index for s in films])
        films = [s for s in films if s.index in moving] or films

    def rank(film: VideoStream) -> tuple[bool, int]:
        size = film.codec_context.width * film.codec_context.height if film.codec_context else 0
        return bool(film.disposition & Disposition.default), size

    chosen = max(films, key=rank)
    if chosen.codec_context is None:
        raise InputError(f"{path} holds a video that FFmpeg has no decoder for; {SUPPORTED}")
    return chosen


def _moving(path: VideoPath, streams: Sequence[int]) -> list[int]:
    """Return which streams have more than one packet: not all containers say how many there are."""
    counts = dict.fromkeys(streams, 0)
    with opened_container(path) as container:
        for packet in container.demux(*container.streams.video):
            if packet.stream_index in counts:
                counts[packet.stream_index] += packet.size > 0
            if min(counts.values()) > 1:
                break
    return [stream for stream, count in counts.items() if count > 1]


def field_of_view_tag(path: VideoPath, container: InputContainer) -> float | None:
    """Return the degrees that the width was rendered to span, by the file's tag; None if it has none.

    Raises
    ------
    InputError
        If the tag is no such angle.
    """
    tag = container.metadata.get(FIELD_OF_VIEW)
    if tag is None:
        return None
    try:
        degrees = float(tag)
    except ValueError:
        degrees = math.nan
    if not NARROWEST <= degrees <= WIDEST:
        raise InputError(
            f"{path}: its tag {FIELD_OF_VIEW} is {tag[:40]!r}; expected {NARROWEST:g} to {WIDEST:g} degrees"
        )
    return degrees


def promised_end(container: InputContainer, stream: VideoStream) -> float:
    """Return when the header of the file says that the stream ends [s], 0 where it says nothing certain."""
    if container.format.name == "avi" and stream.average_rate:
        return float(stream.frames / stream.average_rate)
    if "matroska" not in container.format.name:
        return 0.0  # FFmpeg's own estimate from the size of the file is no promise
    tag = re.fullmatch(r"([0-9]+):([0-9]+):([0-9.]+)", stream.metadata.get("DURATION", ""))
    if tag is not None:
        return 3600 * int(tag[1]) + 60 * int(tag[2]) + float(tag[3])
    alone = len(container.streams) == 1
    return float(container.duration / av.time_base) if alone and container.duration else 0.0
