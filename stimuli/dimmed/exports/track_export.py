"""What is exported of a track, and the file of each format."""

from __future__ import annotations

from pathlib import Path

from evenlight.data_schema.display import Display
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.data_schema.storage.whole_files import write_whole
from evenlight.data_schema.tracks.exported_track import STEP, ExportedTrack
from evenlight.data_schema.tracks.loaded_track import LoadedTrack
from evenlight.stimuli.dimmed.apply_options import DimmedVersion
from evenlight.stimuli.dimmed.dimming import version_factors
from evenlight.stimuli.dimmed.exports.edl import edit_decision_list
from evenlight.stimuli.dimmed.exports.ffmpeg import ffmpeg_script
from evenlight.stimuli.dimmed.exports.mpv import mpv_script


def exported_track(loaded: LoadedTrack, display: Display, version: DimmedVersion) -> ExportedTrack:
    """Return what other programs need of a track.

    Parameters
    ----------
    loaded, display : LoadedTrack, Display
        The track, and the display that it was made for.
    version : DimmedVersion
        By what the video is to be dimmed.
    """
    header = loaded.track.header
    made_of = header.provenance.inputs
    return ExportedTrack(
        video=header.video,
        video_sha256=next((sha for key, sha in made_of.items() if key.startswith("video")), None),
        version=version.value,
        display_name=display.name,
        peak_luminance=display.peak_luminance,
        gamma=display.gamma,
        baseline=loaded.baseline,
        interpolation=STEP,
        times=tuple(loaded.track.times.tolist()),
        factors=tuple(version_factors(loaded, version).tolist()),
        provenance=provenance_now(inputs={"track": loaded.sha256}),
    )


def write_export(path: Path, track: ExportedTrack, to: str) -> None:
    """Write a track for a program: "ffmpeg", "mpv", "json" or "edl".

    Raises
    ------
    InputError
        If the program cannot take this track.
    """
    if to == "json":
        write_json_record(path, track)
    else:
        texts = {"ffmpeg": ffmpeg_script, "mpv": mpv_script, "edl": edit_decision_list}
        write_whole(path, texts[to](track))
