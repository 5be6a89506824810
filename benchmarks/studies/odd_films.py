"""Films of other people: cut, joined, damaged, mirrored; what is in them is known."""

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from av.video.frame import VideoFrame

from evenlight.stimuli.sequences import open_video

N, SIZE = 20, (48, 32)


def encoded(path: Path, codec: str, kind="yuv420p", size=SIZE, first=0, n=N, **options: str) -> Path:
    """A film of moving detail at 25 Hz, whose stamps begin at frame `first`."""
    high, wide = np.indices((64, 96))
    detail = np.rint(127 + 60 * np.sin(wide / 7) * np.cos(high / 5) + 30 * np.sin(wide * high / 300)).astype(
        np.uint8
    )
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=25, options=options)
        stream.width, stream.height, stream.pix_fmt = *size, kind
        for k in range(n):
            gray = np.roll(detail, 5 * (k + first), axis=1)[: size[1], : size[0]]
            frame = VideoFrame.from_ndarray(np.stack([gray, gray[::-1], 255 - gray], axis=-1), "rgb24")
            frame.pts, frame.time_base = k + first, Fraction(1, 25)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def pictures(path: Path, **how: object) -> np.ndarray:
    return np.stack([frame.pixel_values for frame in open_video(path, **how).frames()])


def times(path: Path, **how: object) -> list[float]:
    return [frame.time for frame in open_video(path, **how).frames()]


def copied(source: Path, path: Path, begin: int = 0, overlap: int = 0) -> int:
    """Copy a film from some key frame on, its later half too early; return which picture that frame is."""
    with av.open(str(source)) as there, av.open(str(path), "w") as here:
        stream = here.add_stream_from_template(there.streams.video[0])
        packets = [packet for packet in there.demux(video=0) if packet.size]
        first = [k for k, packet in enumerate(packets) if packet.is_keyframe][begin]
        shown = sum(packet.pts < packets[first].pts for packet in packets)
        for k, packet in enumerate(packets[first:]):
            packet.stream = stream
            if overlap:  # containers of one tick in a millisecond
                packet.pts, packet.dts = 40 * k - 40 * overlap * (k >= N / 2), k - N
            here.mux(packet)
    return shown
