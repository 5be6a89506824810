"""What a track that is to be shown does not go together with."""

from __future__ import annotations

from evenlight.data_schema.recordings.rig import Actuator, Rig
from evenlight.data_schema.tracks.brightness_track import BrightnessTrack

WORTH_SAYING = 0.001  # of contrast loss: what the curves are uncertain by


def floor_note(track: BrightnessTrack, rig: Rig) -> str:
    """Return what pixels lose beyond what a track for a backlight says; empty where that is nothing.

    Parameters
    ----------
    track, rig : BrightnessTrack, Rig
        The track, and what it is to be shown on.
    """
    added = track.header.loss_added_by_pixels or 0.0
    if rig.actuator is Actuator.BACKLIGHT or added < WORTH_SAYING:
        return ""
    return (
        f"note: the track of {track.header.video} was made for a backlight, and here pixels dim, which show "
        f"nothing below black: in some frames at least {added:.2g} more of the visible contrast is lost; "
        "optimize it with --actuator pixels"
    )
