"""A filter script with which any FFmpeg dims a video by its track.

Gamma-encoded R'G'B' times one scale is Y' and the colour differences times that scale, about black and
about gray. So each frame is blended with a black one of the same Y'CbCr format, in 16 bits. Y' above white is
white before; colours above white are not cut off, as `apply` does.
"""

from __future__ import annotations

from evenlight.data_schema.tracks.exported_track import ExportedTrack
from evenlight.stimuli.dimmed.exports.stretches import stretches_of

FRAME_STEP = 10  # [s] more than a frame's time may differ from its track's: by a late start, by rounding
COMMANDS_AT_ONCE = 200  # FFmpeg 5.1 keeps, for each word of a list, as much memory as the rest of the list


def ffmpeg_script(track: ExportedTrack) -> str:
    """Return a filter script: `ffmpeg -filter_complex_script FILE`.

    The clock of the commands counts frames, so that a video that starts late and one of variable rate are
    dimmed by the right frame's factor: `FRAME_STEP` for each frame is added to its time, and taken away.
    """
    stretches = stretches_of(track)
    commands = [  # each from half a step before the time of its first frame on
        f"{track.times[first] + (first - 0.5) * FRAME_STEP:.6f} blend@dim all_opacity {scale:.7f}"
        for first, _, scale in stretches[1:]
    ]
    lists = [
        "sendcmd=c='" + ";\n".join(commands[k : k + COMMANDS_AT_ONCE]) + "',"
        for k in range(0, len(commands), COMMANDS_AT_ONCE)
    ]
    first = stretches[0].scale
    return "\n".join(
        [
            f"sendcmd=c='# {_words(track)}",
            "# ffmpeg -i VIDEO -filter_complex_script FILE -acodec copy -pix_fmt yuv420p OUT",
            "# In FFmpeg 7 and later, -/filter_complex FILE. For whole videos in SDR, for it counts frames.",
            "# Luma above white is cut off, colours above white are not.",
            f"0 blend@dim all_opacity {first:.7f}',",
            f"setpts=PTS+N*{FRAME_STEP}/TB,",
            "scale=out_range=tv, format=yuv420p16le|yuv422p16le|yuv444p16le, limiter=max=60160:planes=1,",
            *lists,
            "split[film][copy];",
            "[copy]limiter=4096:4096:planes=1, limiter=32768:32768:planes=6[black];",
            f"[film][black]blend@dim=all_mode=normal:all_opacity={first:.7f},",
            f"setpts=PTS-N*{FRAME_STEP}/TB",
            "",
        ]
    )


def _words(track: ExportedTrack) -> str:
    """Return what the script is for, without the characters that mean something in it."""
    said = f"Dims {track.video} ({track.version}, gamma {track.gamma:g}), {len(track.times)} frames"
    return "".join(letter if letter.isalnum() or letter in " .,()-_" else "_" for letter in said)
