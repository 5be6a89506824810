"""A script with which mpv dims a video by its track while it plays, on the GPU, without Evenlight."""

from __future__ import annotations

from importlib import resources

import numpy as np

from evenlight.data_schema.tracks.exported_track import ExportedTrack
from evenlight.stimuli.dimmed.exports.stretches import stretches_of


def mpv_script(track: ExportedTrack) -> str:
    """Return a Lua script: `mpv --script=FILE VIDEO`; the template `dim.lua` says how it works."""
    frame = float(np.median(np.diff(track.times))) if len(track.times) > 1 else 0.04
    lines = (f"{track.times[s.first]:.6f} {s.scale:.7f}" for s in stretches_of(track))
    script = (resources.files("evenlight.stimuli.dimmed.exports") / "dim.lua").read_text(encoding="utf-8")
    for name, text in (
        ("VIDEO", " ".join(track.video.split())),
        ("VERSION", track.version),
        ("GAMMA", f"{track.gamma:g}"),
        ("DURATION", f"{track.times[-1] + frame:.6f}"),
        ("FRAME", f"{frame:.6f}"),
        ("TRACK", "\n".join(lines)),
    ):
        script = script.replace(f"@{name}@", text)
    return script
