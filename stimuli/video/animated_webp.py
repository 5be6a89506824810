"""An animated WebP as a film that FFmpeg reads: FFmpeg 8.1 has no reader of its own for it, Pillow has."""

from __future__ import annotations

import io
from fractions import Fraction

import av
import numpy as np
from PIL import Image, ImageSequence

from evenlight.data_schema.storage.input_sizes import MOST_PIXELS, require_size
from evenlight.stimuli.video.video_locations import VideoPath

TICK = Fraction(1, 1000)  # of the file's durations [s]
# What Pillow says of damage.
UNREADABLE = (OSError, EOFError, SyntaxError, ValueError, Image.DecompressionBombError)


def film_of_webp(path: VideoPath, content: bytes) -> io.BytesIO | None:
    """Return an animated WebP as QuickTime Animation, lossless with its alpha and times; None for a still.

    Pictures of 0 ms are never seen, and left out. What is damaged raises one of `UNREADABLE`.
    """
    with Image.open(io.BytesIO(content), formats=["WEBP"]) as image:
        if not getattr(image, "is_animated", False):
            return None
        require_size(image.width * image.height, MOST_PIXELS, path, "pixels a frame")
        film, ticks = io.BytesIO(), 0
        with av.open(film, "w", format="mov") as container:
            stream = container.add_stream("qtrle", rate=1 / TICK)
            stream.width, stream.height, stream.pix_fmt = *image.size, "argb"
            for one in ImageSequence.Iterator(image):
                picture = av.VideoFrame.from_ndarray(np.asarray(one.convert("RGBA")), "rgba")
                lasts = int(one.info["duration"])  # which is this picture's once it is decoded
                picture.pts, picture.duration, picture.time_base = ticks, lasts, TICK
                ticks += lasts
                if lasts:
                    container.mux(stream.encode(picture))
            container.mux(stream.encode())
    film.seek(0)
    return film
