"""What the viewing tasks have in common: seeds, and dropped frames."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Protocol

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.ramp import TrialFlag
from evenlight.data_schema.viewing import ClipLog, Version
from evenlight.experiments.keyed_chance import Purpose, generator_for
from evenlight.experiments.stage import Clip, ShownClip, Stage
from evenlight.experiments.stimulus_folder import LoadedStimulus
from evenlight.experiments.task import TrialPlace

LARGEST_SEED = 2**31


class Shown(Protocol):
    """Something that was shown, refresh by refresh."""

    @property
    def onset(self) -> float:
        """When its first frame appeared, on the stage's clock [s]."""

    @property
    def flip_times(self) -> tuple[float, ...]:
        """Of each refresh, since the first [s]."""

    @property
    def frames_dropped(self) -> int:
        """Refreshes that passed without a new frame."""


def noise_seed_of(session: tuple[int, int], place: TrialPlace) -> int:
    """Return the seed of the dithering noise of a trial."""
    return int(generator_for(*session, Purpose.NOISE, place.trial_index).integers(LARGEST_SEED))


def shown_columns(
    place: TrialPlace, shown: Sequence[Shown], noise_seed: int, max_dropped_share: float
) -> dict[str, Any]:
    """Return the columns of a row that say whose it is, and how it was shown."""
    refreshes = sum(len(part.flip_times) for part in shown)
    dropped = sum(part.frames_dropped for part in shown)
    too_many = dropped > max_dropped_share * (refreshes + dropped)
    return {
        "participant_id": place.participant_id,
        "session_id": place.session_id,
        "trial_index": place.trial_index,
        "simulated": place.simulated,
        "attempt": place.attempt,
        "onset": shown[0].onset,
        "noise_seed": noise_seed,
        "n_frames": refreshes,
        "frames_dropped": dropped,
        "flag": TrialFlag.DROPPED_FRAMES if too_many else TrialFlag.NONE,
    }


def stimulus_clip(stimulus: LoadedStimulus, version: Version, noise_seed: int, seconds: float | None) -> Clip:
    """Return a version of a sequence, to be played."""
    times = stimulus.track.times
    return Clip(
        video=stimulus.video,
        times=times - times[0],
        duration=stimulus.stimulus.duration,
        factors=stimulus.factors(version),
        noise_seed=noise_seed,
        seconds=seconds,
    )


def require_room(stimuli: Iterable[LoadedStimulus], stage: Stage) -> None:
    """Refuse videos that are larger than the stage; they are shown pixel by pixel."""
    room = stage.room()
    for stimulus in stimuli:
        if room is None or stimulus.size is None:
            continue
        if stimulus.size[0] > room[0] or stimulus.size[1] > room[1]:
            raise InputError(
                f"{stimulus.folder}: the video has {stimulus.size[0]}x{stimulus.size[1]} pixels, and the "
                f"window {room[0]}x{room[1]}: render it at --size {room[0]}x{room[1]}, or smaller"
            )


def clip_log(place: TrialPlace, interval: int, shown: ShownClip) -> ClipLog:
    """Return what the display showed of a video, as a record."""
    return ClipLog(
        trial_index=place.trial_index,
        attempt=place.attempt,
        interval=interval,
        flip_times=shown.flip_times,
        video_frames=shown.video_frames,
        factors=shown.factors,
        backlight_factors=shown.backlight_factors,
        probe_refreshes=shown.probe_refreshes,
        probe_luminance=shown.probe_luminance,
        probe_intended=shown.probe_intended,
        waited=shown.waited,
    )
