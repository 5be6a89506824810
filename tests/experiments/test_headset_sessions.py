"""Whole sessions in a headset that is made up: its runtime, its wearer and its operator follow a script."""

import dataclasses
import gc
import json
import math
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from headset_frames import since
from played_in_headset import watch

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.dataset_layout import EVENTS, FRAMES, HEADSET, MANIFEST, TRIALS
from evenlight.data_schema.recordings.ramp import Procedure, RampDesign
from evenlight.data_schema.recordings.search import SearchDesign
from evenlight.data_schema.recordings.session import SessionStatus
from evenlight.data_schema.recordings.viewing import ComparisonDesign, RatingDesign
from evenlight.experiments import run_session as running
from evenlight.experiments.headset import headset_stage
from evenlight.experiments.headset.headset_stage import (
    BROKEN_OFF,
    NOT_SHOWN,
    NOT_TRACKED,
    NOT_WORN,
    RECENTRED,
    HeadsetStage,
)
from evenlight.experiments.run_session import SessionOutcome, SessionRequest, run_session
from evenlight.experiments.sessions.pages import load_pages
from evenlight.experiments.sessions.session_store import SessionStore
from evenlight.experiments.sessions.staging import Staging
from evenlight.hardware.presentation import headset_window
from evenlight.hardware.presentation.headset_views import EyeFov, HeadsetFacts, Pose, centre_pixels_per_degree
from evenlight.hardware.protocols import InstrumentError, KeyPress
from evenlight.hardware.rig_files import load_rig
from evenlight.hardware.simulated.headset import HeadsetScript, SimulatedHeadset, gentle_motion
from evenlight.method.preset_files import load_display

RATE = 20.0  # [Hz]
NAMES = ("bright", "dark")
SIZE = (128, 128)
RIG = dataclasses.replace(load_rig("simulated-headset")[0], window_size=SIZE, refresh_rate=RATE)
DISPLAY = load_display("varjo-xr3")
RAMPS = RampDesign(
    screens=("white",), factors=(0.4, 0.9), relative_rates=(0.1, 0.4), repetitions=1, catch_share=0.2,
    adaptation_duration=0.2, ramp_durations=(0.5,), hold_duration=0.1, pause_duration=0.1,
    practice_trials=1, trials_between_breaks=3,
)  # fmt: skip
DESIGNS: dict[str, Any] = {
    "ramp": RAMPS,
    "rating": RatingDesign(NAMES, adaptation_duration=0.1, practice_trials=1, practice_duration=0.5),
    "comparison": ComparisonDesign(
        NAMES, repetitions=2, adaptation_duration=0.1, practice_trials=1, practice_duration=0.5
    ),
    # 120 arcmin are 2.2 pixels of the coarse pictures.
    "search": SearchDesign(
        ("library",), ("library/schoolyard",), ring_gap=120.0, ring_contrast=-0.9, time_limit=0.6,
        adaptation_duration=0.1, practice_trials=1, trials_between_breaks=3,
    ),
}  # fmt: skip
# A wearer who pushes the stick to the right and pulls the trigger, again and again.
EAGER = tuple(
    KeyPress(name, 0.25 * k + after)
    for k in range(1, 2000)
    for name, after in (("stick_right", 0.0), ("trigger", 0.125))
)


@pytest.fixture(autouse=True, scope="module")
def _small_panel() -> Iterator[None]:
    """A panel of pages with a quarter of the pixels: its text is as large, and no test reads it."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (headset_stage, headset_window):
            patch.setattr(module, "PANEL_SIZE", (640, 480))
        yield


@pytest.fixture(scope="module")
def stimuli(
    tmp_path_factory: pytest.TempPathFactory,
    make_stimulus: Callable[..., None],
    make_video: Callable[..., None],
) -> Path:
    """Two short videos with their tracks, and a track for the camera path of the search."""
    folder = tmp_path_factory.mktemp("stimuli")
    frames = np.arange(6)
    for name, level in zip(NAMES, (0.8, 0.3), strict=True):
        make_stimulus(folder / name, 0.5 + 0.2 * np.sin(frames / 3), frames_per_second=10.0)
        make_video(folder / name / "video.mkv", level * (1 + frames / 40), (160, 96), 10.0)
    make_stimulus(folder / "library", np.linspace(0.3, 0.7, 750), frames_per_second=10.0)  # 75 s
    return folder


class Laboratory:
    """A data set, and sessions in it."""

    def __init__(self, folder: Path, stimuli: Path, patch: pytest.MonkeyPatch) -> None:
        self.folder, self._stimuli, self._patch = folder, stimuli, patch
        self._begun: dict[str, float] = {}  # when each session began that is kept [s]
        self.began = 0.0  # when the last session did, on the headset's clock
        self.told: list[str] = []

    def run(
        self,
        task: str = "ramp",
        name: str = "lab",
        script: HeadsetScript | None = None,
        mirror: Any = None,
        **changes: Any,
    ) -> SessionOutcome:
        """Conduct a session: a rehearsal, or with a wearer who follows a script."""

        def opened(*_: object, **__: object) -> SimulatedHeadset:
            headset = SimulatedHeadset(SIZE, RATE, script)
            if mirror is not None:
                headset.mirror, mirror.now = mirror, headset.now
            return headset

        use_clock = SessionStore.use_clock

        def noted(store: SessionStore, clock: Callable[[], float]) -> None:
            self.began = clock()
            use_clock(store, clock)

        self._patch.setattr(running, "open_headset", opened)
        with self._patch.context() as patch:
            patch.setattr(SessionStore, "use_clock", noted)
            return run_session(self._request(task, name, script, **changes), tell=self.told.append)

    def _request(self, task: str, name: str, script: HeadsetScript | None, **changes: Any) -> SessionRequest:
        request = SessionRequest(
            task=task, dataset=self.folder / name, participant_id="01", session_id="01", rig=RIG,
            display=DISPLAY, design=DESIGNS[task], pages=load_pages("en", in_headset=True),
            staging=Staging("visual" if script is None else None), seed=4,
            stimuli=None if task == "ramp" else self._stimuli,
        )  # fmt: skip
        return dataclasses.replace(request, **changes)

    def kept(self, name: str) -> "Laboratory":
        """Return this laboratory with a task's session: a rehearsal, or (`TASK-eager`) one with a wearer."""
        if name not in self._begun:
            task, _, eager = name.partition("-")
            outcome = self.run(task, name, HeadsetScript(presses=EAGER) if eager else None)
            assert outcome.status is SessionStatus.COMPLETE
            self._begun[name] = self.began
        self.began = self._begun[name]
        return self

    def rows(self, file: str = TRIALS, name: str = "lab") -> list[dict[str, Any]]:
        text = (self.folder / name / "sub-01/ses-01" / file).read_text()
        return [json.loads(line) for line in text.splitlines()]

    def happened(self, kind: str) -> list[str]:
        return [event["detail"] for event in self.rows(EVENTS) if event["kind"] == kind]

    def shown_at(self, trial: int, frame: int, name: str) -> float:
        """When a frame of a trial appeared in a session, on the headset's clock [s]."""
        logs = self.rows(HEADSET, name)
        times = next(log for log in logs if log["trial_index"] == trial)["display_times_s"]
        return float(times[frame]) + self.began


@pytest.fixture
def lab(tmp_path: Path, stimuli: Path, monkeypatch: pytest.MonkeyPatch) -> Laboratory:
    return Laboratory(tmp_path, stimuli, monkeypatch)


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory, stimuli: Path) -> Iterator[Laboratory]:
    """A laboratory whose sessions are only read, by several tests."""
    with pytest.MonkeyPatch.context() as patch:
        yield Laboratory(tmp_path_factory.mktemp("stored"), stimuli, patch)


@pytest.mark.parametrize("task", list(DESIGNS))
def test_a_session_goes_to_its_end(stored: Laboratory, command: Any, task: str) -> None:
    checked = command("validate", stored.kept(task).folder / task)
    assert checked.code == 0, checked.out


def test_a_session_is_the_same_again(lab: Laboratory, stored: Laboratory) -> None:
    lab.run()
    for file in (TRIALS, FRAMES, HEADSET):
        assert lab.rows(file) == stored.kept("ramp").rows(file, "ramp")


def distance(pose: Pose, place: np.ndarray, turned: np.ndarray, origin: Pose) -> float:
    """How far a logged place and quaternion are from a pose as seen from an origin, at most."""
    wanted, rotation = since(pose, origin)
    return float(max(np.abs(place - wanted).max(), np.abs(turned - rotation.as_quat()).max()))


@pytest.mark.parametrize("task", ["ramp", "comparison"])
def test_each_shown_frame_is_logged_with_the_head_at_its_time(stored: Laboratory, task: str) -> None:
    """A trial of a comparison has two intervals; where the head looks as each begins is straight ahead."""
    name = f"{task}-eager"
    lab = stored.kept(name)
    frames, logs = lab.rows(FRAMES, name), lab.rows(HEADSET, name)
    assert len(logs) == len(frames) > 4
    for shown, log in zip(frames, logs, strict=True):
        for key in ("trial_index", "attempt", "interval"):
            assert shown[key] == log[key]
        times = np.array(log["display_times_s"])
        np.testing.assert_allclose(times - times[0], shown["flip_times_s"], atol=1e-8)
        poses = [gentle_motion(time + lab.began) for time in times]
        place = np.transpose([log[f"head_{axis}_m"] for axis in ("right", "up", "back")])
        turned = np.transpose([log[f"orientation_{axis}"] for axis in ("x", "y", "z", "real")])
        # One origin for all of them: the head's place and heading at a refresh before the first one.
        off = min(
            max(distance(*one, origin) for one in zip(poses, place, turned, strict=True))
            for origin in (gentle_motion(times[0] + lab.began - k / RATE) for k in range(20))
        )
        assert off < 3e-6
        assert set(log["late_frames"]) == {0}
        assert all(log["focused"])
        assert all(log["tracked"])
    for trial in lab.rows(name=name):
        first = next(log for log in logs if log["trial_index"] == trial["trial_index"])
        assert first["display_times_s"][0] == pytest.approx(trial["onset_s"], abs=1e-6)


def test_where_the_eyes_look_is_logged_in_the_axes_of_the_head(lab: Laboratory, stored: Laboratory) -> None:
    """They look 45 degrees to the right of where the head looks, and blink."""
    turned = Pose(orientation=(0.0, math.sin(math.pi / 3), 0.0, 0.5))  # by 120 degrees, to the left
    aside = Pose(orientation=(0.0, math.sin(math.radians(37.5)), 0.0, math.cos(math.radians(37.5))))  # by 75
    script = HeadsetScript(
        head=lambda _: turned, gaze=lambda when: aside if when % 0.5 < 0.4 else None, presses=EAGER
    )
    assert lab.run(script=script).status is SessionStatus.COMPLETE
    looks = {
        tuple(np.round(look, 5))
        for log in lab.rows(HEADSET)
        for look in zip(*(log[f"gaze_{axis}"] for axis in ("right", "up", "back")), strict=True)
    }
    assert looks == {(0.70711, 0.0, -0.70711), (0.0, 0.0, 0.0)}
    assert not any(log.get("gaze_up") for log in stored.kept("ramp").rows(HEADSET, "ramp"))  # never known


def test_the_runtime_says_refresh_rate_and_pixels_per_degree(lab: Laboratory) -> None:
    """Edges at 47 and 43 degrees, 128 pixels between them: 1.115 pixels per degree in the middle."""
    lab.run(rig=dataclasses.replace(RIG, refresh_rate=90.0))
    manifest = json.loads((lab.folder / "lab/sub-01/ses-01" / MANIFEST).read_text())
    tangents = np.tan(np.radians([47.0, 43.0])).sum()
    expected = 128 / tangents * np.pi / 180
    assert manifest["display"]["pixels_per_degree"] == pytest.approx(expected)
    assert manifest["rig"]["refresh_rate_hz"] == RATE
    fov = SimulatedHeadset((64, 64)).facts().fovs[0]
    assert centre_pixels_per_degree(fov, 128) == pytest.approx(expected)


def test_drawn_means_are_the_ramps(stored: Laboratory) -> None:
    for trial in stored.kept("ramp").rows(name="ramp"):
        assert trial["largest_luminance_error_cd_m2"] < 0.3  # noise over 128 x 128 pixels of one eye


def test_a_rehearsal_reads_back_ramps_with_a_mark_and_with_numbers(lab: Laboratory) -> None:
    """Two intervals for each question, and the mark that observers look at: above the panel that has them."""
    design = dataclasses.replace(RAMPS, procedure=Procedure.TWO_INTERVAL, catch_share=0.0, fixation_mark=True)
    assert lab.run(design=design).status is SessionStatus.COMPLETE
    assert len(lab.rows()) > 3
    assert all(len(log["probe_frames"]) > 3 for log in lab.rows(FRAMES))
    assert all(trial["largest_luminance_error_cd_m2"] < 0.3 for trial in lab.rows())


def test_a_session_reads_ramps_back_when_they_are_over(
    lab: Laboratory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a wearer; what was read is taken before the first refresh after an interval, and at no other."""
    given = watch(monkeypatch, read=False)
    lab.run(script=HeadsetScript(presses=EAGER))
    logs = lab.rows(FRAMES)
    assert sum(one.counts["Framebuffer.read"] for one in given) == 0
    taken = [one.counts["Buffer.read"] for one in given if one.counts["Buffer.read"]]
    assert taken == [12, *(len(log["probe_frames"]) for log in logs)]  # the practice has no log
    assert all(trial["largest_luminance_error_cd_m2"] < 0.3 for trial in lab.rows())
    for log in logs:  # they are of the frames that they are said to be of
        intended = np.array(log["intended_luminance_cd_m2"])[log["probe_frames"]]
        np.testing.assert_allclose(log["probe_luminance_cd_m2"], intended, atol=0.3)


def test_no_garbage_is_collected_in_trials(lab: Laboratory, monkeypatch: pytest.MonkeyPatch) -> None:
    collects: dict[str, set[bool]] = {"show_ramp": set(), "show_page": set()}
    for name, seen in collects.items():
        plain = getattr(HeadsetStage, name)

        def watched(*arguments: Any, plain: Any = plain, seen: set[bool] = seen, **options: Any) -> Any:
            seen.add(gc.isenabled())
            return plain(*arguments, **options)

        monkeypatch.setattr(HeadsetStage, name, watched)
    gc.enable()
    lab.run()
    assert collects == {"show_ramp": {False}, "show_page": {True}}


def test_controllers_answer(stored: Laboratory) -> None:
    """Pushed to the right once, the stick marks the second of two answers, which is no."""
    trials = stored.kept("ramp-eager").rows(name="ramp-eager")
    assert {trial["response"] for trial in trials} == {"no"}
    # The stick is pushed every 0.25 s, the trigger pulled 0.125 s later.
    assert all(0 < trial["response_time_s"] <= 0.25 + 0.125 + 2 / RATE for trial in trials)


@pytest.mark.parametrize("focus_size", [None, (64, 64)])
def test_in_a_search_the_trigger_finds_and_the_stick_points_to_the_gap(lab: Laboratory, focus_size) -> None:
    """The room turns right by a step of 10 degrees for each push; up is 90 degrees."""
    script = HeadsetScript(
        head=lambda _: gentle_motion(0.0), presses=EAGER, stick=lambda _: (0.1, 0.9), focus_size=focus_size
    )
    assert lab.run("search", script=script).status is SessionStatus.COMPLETE
    assert all(trial["found"] and trial["reported_orientation_deg"] == 90 for trial in lab.rows())
    for log in lab.rows(FRAMES):
        assert set(log["azimuths_deg"]) <= {0.0, 10.0, 20.0}
        assert set(log["altitudes_deg"]) == {0.0}


@pytest.mark.parametrize(
    ("what", "column", "why"),
    [
        ("unfocused", "focused", NOT_WORN),
        ("untracked", "tracked", NOT_TRACKED),
        ("invisible", "visible", NOT_SHOWN),
    ],
)
def test_a_trial_that_was_not_seen_is_shown_again(
    lab: Laboratory, stored: Laboratory, what: str, column: str, why: str
) -> None:
    taken_off = stored.kept("ramp-eager").shown_at(2, 5, "ramp-eager")
    gone = HeadsetScript(presses=EAGER, **{what: [(taken_off, taken_off + 1.0)]})
    assert lab.run(script=gone).status is SessionStatus.COMPLETE
    events = [(event["kind"], event["detail"]) for event in lab.rows(EVENTS)]
    broken = events.index(("trial_interrupted", f"{why}; it is shown again"))
    kinds = [kind for kind, _ in events[broken + 1 :][:4]]
    assert kinds == ["paused", "page_shown", "continued", "trial_begun"]
    assert [trial["attempt"] for trial in lab.rows()] == [1, 1, 2, *[1] * (len(lab.rows()) - 3)]
    assert len(lab.rows()) == len(stored.rows(name="ramp-eager"))
    # The interval that was broken off is logged, too, and of all of them alone not seen.
    unseen = [log for log in lab.rows(HEADSET) if not all(log[column])]
    assert all((log["trial_index"], log["attempt"]) == (2, 1) for log in unseen)
    assert (2, 1) in [(log["trial_index"], log["attempt"]) for log in lab.rows(HEADSET)]


@pytest.mark.parametrize("by", ["the runtime", "F4", "the menu button"])
def test_a_trial_in_which_straight_ahead_is_set_anew_is_shown_again(
    lab: Laboratory, stored: Laboratory, by: str
) -> None:
    """The head jumps with the runtime's axes: what is shown stands before it all the same."""
    shown = stored.kept("ramp-eager").shown_at(2, 5, "ramp-eager")

    def head(when: float) -> Pose:
        return Pose((0.0, 0.0, 0.0 if when < shown else 2.0))

    held = [KeyPress("menu_held", shown)] if by == "the menu button" else []
    presses = sorted([*EAGER, *held], key=lambda press: press.time)
    script = HeadsetScript(head=head, presses=presses, recentred=[shown] if by == "the runtime" else [])
    mirror = Mirror(KeyPress("f4", shown)) if by == "F4" else None
    assert lab.run(script=script, mirror=mirror).status is SessionStatus.COMPLETE
    assert lab.happened("trial_interrupted") == [f"{RECENTRED}; it is shown again"]
    assert [trial["attempt"] for trial in lab.rows()] == [1, 1, 2, *[1] * (len(lab.rows()) - 3)]
    seen = [log for log in lab.rows(HEADSET) if (log["trial_index"], log["attempt"]) != (2, 1)]
    assert {back for log in seen for back in log["head_back_m"]} == {0.0}


def test_a_runtime_that_goes_away_costs_no_trial(lab: Laboratory, stored: Laboratory, command: Any) -> None:
    shown = stored.kept("ramp-eager").shown_at(2, 5, "ramp-eager")
    with pytest.raises(InstrumentError, match="the runtime went away"):
        lab.run(script=HeadsetScript(presses=EAGER, lost_at=round(shown * RATE)))
    assert len(lab.rows()) == 2
    assert "the runtime went away" in lab.happened("stopped")[-1]
    assert lab.run(script=HeadsetScript(presses=EAGER), resume=True).status is SessionStatus.COMPLETE
    assert len(lab.rows()) == len(stored.rows(name="ramp-eager"))
    assert command("validate", lab.folder / "lab").code == 0


@pytest.mark.parametrize("task", ["ramp", "comparison"])
def test_a_session_goes_on_where_the_runtime_says_nearly_the_same(
    lab: Laboratory, stored: Laboratory, monkeypatch: pytest.MonkeyPatch, task: str
) -> None:
    """A millionth of its refresh rate, and a hundredth of its pixels per degree with the eyes' distance."""
    dry = f"{task}-eager"
    shown = stored.kept(dry).shown_at(2, 0, dry)
    with pytest.raises(InstrumentError):
        lab.run(task, script=HeadsetScript(presses=EAGER, lost_at=round(shown * RATE)))
    begun = json.loads((lab.folder / "lab/sub-01/ses-01" / MANIFEST).read_text())
    facts = SimulatedHeadset.facts

    def moved(headset: SimulatedHeadset, rate: float = 1 + 1e-6, share: float = 0.99) -> HeadsetFacts:
        said = facts(headset)
        left, right = (
            EyeFov(*(math.atan(math.tan(angle) / share) for angle in dataclasses.astuple(fov)))
            for fov in said.fovs
        )
        return dataclasses.replace(said, refresh_rate=rate * said.refresh_rate, fovs=(left, right))

    monkeypatch.setattr(SimulatedHeadset, "facts", lambda headset: moved(headset, rate=1.05))
    with pytest.raises(InputError, match="--rig is not as it was"):
        lab.run(task, script=HeadsetScript(presses=EAGER), resume=True)
    monkeypatch.setattr(SimulatedHeadset, "facts", moved)
    assert lab.run(task, script=HeadsetScript(presses=EAGER), resume=True).status is SessionStatus.COMPLETE
    ended = json.loads((lab.folder / "lab/sub-01/ses-01" / MANIFEST).read_text())
    assert (ended["rig"], ended["display"]) == (begun["rig"], begun["display"])


def test_a_video_too_wide_for_a_flat_screen_is_refused_before_the_session(
    lab: Laboratory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the middle of 24 pixels a degree has 0.209 of them: 160 are 163 degrees."""
    expected = 2 * math.degrees(math.atan(80 * np.tan(np.radians([47.0, 43.0])).sum() / 24))
    said = dataclasses.replace(SimulatedHeadset((64, 64)).facts(), eye_size=(24, 24))
    monkeypatch.setattr(SimulatedHeadset, "facts", lambda _: said)
    with pytest.raises(InputError, match=f"would be {expected:.4g} degrees wide, and a flat screen"):
        lab.run("comparison", rig=dataclasses.replace(RIG, full_screen=True))
    assert not (lab.folder / "lab").exists()


class Mirror:
    """An operator who presses keys at some times on the headset's clock; and what the strip says."""

    def __init__(self, *keys: KeyPress) -> None:
        self._keys, self.now, self.said = list(keys), float, 0

    def take(self, *_: object) -> None:
        pass

    def show(self) -> None:
        pass

    def say(self, coverage: np.ndarray) -> None:
        assert coverage.shape == (96, 960)
        assert coverage.max() > 200
        self.said += 1

    def pressed(self) -> list[KeyPress]:
        due = [press for press in self._keys if press.time <= self.now()]
        self._keys = self._keys[len(due) :]
        return due


def test_the_operator_breaks_off_a_trial_pauses_and_stops(lab: Laboratory, stored: Laboratory) -> None:
    """The participant presses nothing more once the operator has paused, so that the page stays."""
    broken_off = stored.kept("ramp-eager").shown_at(1, 5, "ramp-eager")
    paused = broken_off + 20.0
    mirror = Mirror(KeyPress("f2", broken_off), KeyPress("f1", paused), KeyPress("f3", paused + 2.0))
    until = [press for press in EAGER if press.time < broken_off + 0.5]
    outcome = lab.run(script=HeadsetScript(presses=until), mirror=mirror)
    assert (outcome.status, outcome.reason) == (SessionStatus.ABORTED, "by the operator")
    assert lab.happened("trial_interrupted") == [
        f"{BROKEN_OFF}; it is shown again",
        "paused; it is shown again",
    ]
    assert len(lab.happened("paused")) == 1
    assert mirror.said > 3


def test_the_operators_keyboard_answers_and_goes_on(lab: Laboratory) -> None:
    """Every half a second a page is left with the space bar, or a question answered with y."""
    keys = [KeyPress(name, 0.5 * k) for k in range(1, 1000) for name in ("space", "y")]
    assert lab.run(script=HeadsetScript(), mirror=Mirror(*keys)).status is SessionStatus.COMPLETE
    assert {trial["response"] for trial in lab.rows()} == {"yes"}


def test_nobody_wears_it_and_a_page_stays(lab: Laboratory) -> None:
    """Without a wearer a page is not left, and the key that stops ends the session all the same."""
    away = HeadsetScript(presses=EAGER, unfocused=[(0.0, 1e9)])
    mirror = Mirror(KeyPress("f2", 1.0), KeyPress("f3", 4.0))
    outcome = lab.run(script=away, mirror=mirror)
    assert outcome.reason == "by the operator"
    assert lab.happened("page_shown") == ["consent"]


def test_a_rehearsal_without_a_window_opens_no_headset(lab: Laboratory, monkeypatch) -> None:
    outcome = lab.run(staging=Staging("data"))
    assert outcome.status is SessionStatus.COMPLETE
    assert not (outcome.folder / HEADSET).exists()
    assert any("no headset is asked" in words for words in lab.told)


def test_validation_finds_frames_of_the_headset_that_are_lost(
    lab: Laboratory, stored: Laboratory, command: Any
) -> None:
    shutil.copytree(stored.kept("ramp-eager").folder / "ramp-eager", lab.folder / "lab")
    path = lab.folder / "lab/sub-01/ses-01" / HEADSET
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[1:]))
    ended = command("validate", lab.folder / "lab")
    assert ended.code == 1
    assert f"{HEADSET}: no frames of trial 0, attempt 1, interval 1" in ended.out
    path.unlink()
    assert command("validate", lab.folder / "lab").code == 1


def test_an_export_takes_the_log_along(lab: Laboratory, stored: Laboratory, command: Any) -> None:
    shutil.copytree(stored.kept("ramp-eager").folder / "ramp-eager", lab.folder / "lab")
    assert command("export", lab.folder / "lab", "--to", "bids", "--out", lab.folder / "bids").code == 0
    copied = lab.folder / "bids/sub-01/ses-01" / HEADSET
    assert copied.read_bytes() == (lab.folder / "lab/sub-01/ses-01" / HEADSET).read_bytes()
    assert HEADSET in (lab.folder / "bids/.bidsignore").read_text()
