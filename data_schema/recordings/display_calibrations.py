"""Calibrations of one display in a data set: which sessions can be fitted together, and why others cannot.

A rate limit holds for one display, but a display changes while a study goes on, and is measured again. Levels
and rates stand in the luminance measured for each session, so that sessions under several calibrations of one
display make one rate limit (docs/decisions/a-result-knows-its-display.md).
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.dataset_layout import MANIFEST, TRIALS
from evenlight.data_schema.recordings.ramp import TrialFlag
from evenlight.data_schema.recordings.roll_call import RollCall, call_roll
from evenlight.data_schema.recordings.session import SessionManifest
from evenlight.data_schema.storage.text_files import read_json_record, read_text

FITTED_TASK = "ramp"  # whose sessions are fitted together
LARGEST_RATIO = 1.25  # of the luminances of one pixel value and factor under two calibrations (choice)
# Pixel value and brightness factor of what is compared: white and gray, at full brightness and dimmed.
COMPARED_AT = ((1.0, 1.0), (0.5, 1.0), (1.0, 0.2), (0.5, 0.2))
APART = "put the sessions of each in a data set of its own (`run`: another --out)"


def why_apart(sessions: Sequence[SessionManifest]) -> str:
    """Return why the ramps of some sessions cannot be fitted together, and the way out; empty if they can.

    Calibrations of one display have a name in common, and luminances within `LARGEST_RATIO` of each other at
    the pixel values and factors of `COMPARED_AT`. Of the same photometry they are one, by all of its names.
    """
    names: dict[str, set[str]] = {}  # by fingerprint
    for shown in (session.display for session in sessions):
        if shown is not None:
            names.setdefault(shown.fingerprint, set()).add(shown.name)
    kept: dict[str, tuple[str, Display]] = {}
    for session in sessions:
        name, display = _named(session), session.display
        if display is None:
            return (
                f"{name} has no display ({MANIFEST}: display is null); expected that of the ramps, for which "
                "alone their rate limit holds"
            )
        for key, other in kept.items():
            if why := _why_other(display, *other, renamed=names[key].isdisjoint(names[display.fingerprint])):
                return f"{name} runs on the display {display.name!r}{why}"
        kept.setdefault(display.fingerprint, (name, display))
    return ""


def _named(session: SessionManifest) -> str:
    return f"session {session.session_id} of participant {session.participant_id}"


def _why_other(display: Display, other_session: str, other: Display, *, renamed: bool) -> str:
    """Return why a display is not that of another session, measured again; empty if it may be."""
    if renamed:
        return (
            f", {other_session} on {other.name!r}: a rate limit holds for one display; {APART}, or, if it is "
            f"one panel measured again, give its file the name {other.name!r}"
        )
    pairs = [(_luminance(display, *at), _luminance(other, *at), at) for at in COMPARED_AT]
    found = [(round(max(a, b) / min(a, b), 9), a, b, at) for a, b, at in pairs]
    ratio, own, others, (value, factor) = max(found, key=lambda each: each[0])  # of equal ones, white
    if ratio <= LARGEST_RATIO:
        return ""
    return (
        f" with {own:.4g} cd/m^2 at pixel value {value:g} and factor {factor:g}, {other_session} with "
        f"{others:.4g}: a ratio of {ratio:.3g}, and that of two calibrations of one display is at most "
        f"{LARGEST_RATIO:g}; put the panel's brightness, the meter and the room's light as they were and "
        f"measure again, or {APART}"
    )


def _luminance(display: Display, pixel_value: float, factor: float) -> float:
    """Return the luminance b · I + L_refl of a gray (Eq. 1) [cd/m^2]."""
    linear: float = pixel_value**display.gamma
    emitted = linear * (display.peak_luminance - display.black_level) + display.black_level
    return factor * emitted + display.reflected_luminance


def calibrations_of(sessions: Sequence[SessionManifest]) -> tuple[Display, ...]:
    """Return the calibrations that sessions ran on, each once, in order of measuring.

    One that does not say when it was measured counts as measured when its last session began.
    """
    found: dict[str, tuple[str, Display]] = {}
    for session in sessions:
        if session.display is not None:
            key, when = session.display.fingerprint, session.display.measured or session.started
            before, display = found.get(key, ("", session.display))
            found[key] = (max(before, when), display)
    return tuple(display for _, display in sorted(found.values(), key=lambda dated: dated[0]))


def calibrations_in_words(sessions: Sequence[SessionManifest]) -> str:
    """Return which calibrations of a display some sessions ran on; empty if it is one."""
    displays = calibrations_of(sessions)
    if len(displays) < 2:
        return ""
    prints = [session.display.fingerprint for session in sessions if session.display]
    each = "; ".join(f"{d.calibration}, sessions: {prints.count(d.fingerprint)}" for d in displays)
    return (
        f"the display {displays[-1].name!r} was measured again between sessions ({each}); levels and rates "
        "are in the luminance measured for each session"
    )


def require_joinable(dataset: Path, session: SessionManifest) -> str:
    """Return how a session's display is calibrated otherwise than in the sessions before it.

    Empty for the newest calibration of them, and for tasks whose sessions are not fitted together.

    Parameters
    ----------
    dataset : Path
        Where the session goes; it need not be there yet.
    session : SessionManifest
        The session that is to begin, or to go on.

    Raises
    ------
    InputError
        If the ramps of the session cannot be fitted together with those of the data set.
    """
    if session.task != FITTED_TASK or session.display is None or not dataset.is_dir():
        return ""
    earlier = [one for one in ramp_sessions(dataset, call_roll(dataset)) if _named(one) != _named(session)]
    if why := why_apart([*earlier, session]):
        raise InputError(f"{dataset}: {why}")
    known = calibrations_of(earlier)
    if not known or known[-1].fingerprint == session.display.fingerprint:
        return ""
    return (
        f"the display {session.display.name!r} has another calibration than in earlier sessions: "
        f"{session.display.calibration}; the newest of theirs, {known[-1].calibration}"
    )


def ramp_sessions(dataset: Path, roll: RollCall) -> tuple[SessionManifest, ...]:
    """Return the manifests of the sessions whose ramps are fitted; without those that cannot be read."""
    return tuple(_with_ramps(dataset / entry.folder for entry in roll.read if entry.task == FITTED_TASK))


def _with_ramps(folders: Iterable[Path]) -> Iterator[SessionManifest]:
    for folder in folders:
        with suppress(InputError):  # `validate` and `fit` say what cannot be read
            if any(_counts(line) for line in read_text(folder / TRIALS, "trials").split("\n")):
                yield read_json_record(SessionManifest, folder / MANIFEST)


def _counts(line: str) -> bool:
    try:
        trial = json.loads(line)
    except (ValueError, RecursionError):  # torn, or empty
        return False
    flag = TrialFlag.NONE.value
    return isinstance(trial, dict) and not trial.get("practice") and trial.get("flag", flag) == flag
