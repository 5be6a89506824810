"""A display that drops frames: who is told, what is shown again, and what a pause counts."""

from pathlib import Path
from types import SimpleNamespace

import pytest
from conducted_sessions import Stage, begun, conducted, drop_ten_frames

from evenlight.data_schema.recordings.dataset_layout import TRIALS, session_folder
from evenlight.data_schema.recordings.ramp import TrialFlag
from evenlight.experiments import run_command, run_session
from evenlight.experiments.sessions.dropped_frames import drop_counts
from evenlight.experiments.sessions.fixed_order import FixedOrder, PlannedTrial
from evenlight.experiments.stage import PausePressed, ShownInterval


def pause(_: ShownInterval) -> ShownInterval:
    raise PausePressed


def test_a_pause_counts_what_is_to_be_shown_again_among_what_is_left(tmp_path: Path) -> None:
    """5 trials, of which the second is flagged: before its second showing, the last, 5 of 6 are done."""
    stage = Stage({1: drop_ten_frames, 5: pause})
    conducted(begun(tmp_path / "lab"), stage)
    (told,) = (page for page in stage.pages if page.startswith("# Paused"))
    assert "You have done 5 of 6 trials." in told


def test_the_experimenter_is_told_of_dropped_frames_at_once_and_on_the_next_pause(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    store = begun(tmp_path / "lab")
    stage = Stage({1: drop_ten_frames, 3: pause})
    conducted(store, stage)
    frames = store.trials[1].n_frames + 10
    said = capsys.readouterr().err
    assert f"dropped too many frames in 1 of 2 trials, 10 of {frames} in one: close other programs" in said
    (told,) = (page for page in stage.pages if page.startswith("# Paused"))
    assert f"in 1 of 3 trials the display skipped too many frames, 10 of {frames} in one. Close" in told


def test_a_session_without_drops_says_nothing_of_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stage = Stage({3: pause})
    conducted(begun(tmp_path / "lab"), stage)
    assert not any("For the experimenter" in page for page in stage.pages)
    assert "dropped" not in capsys.readouterr().err


def test_the_worst_of_the_flagged_trials_is_named() -> None:
    def trial(dropped: int, flag: TrialFlag = TrialFlag.DROPPED_FRAMES) -> SimpleNamespace:
        return SimpleNamespace(frames_dropped=dropped, n_frames=100, flag=flag)

    shown = [trial(3), trial(99, TrialFlag.NONE), trial(20)]
    assert drop_counts(shown) == {"flagged": 2, "answered": 3, "dropped": 20, "frames": 120}
    assert drop_counts(shown[1:2]) == {}


def clip(name: str) -> PlannedTrial:
    return PlannedTrial({"sequence": name}, block=1)


def showings(flags: str) -> int:
    """Return how many of 8 videos are shown; those marked x are flagged, later ones as the last."""
    order, n = FixedOrder([clip(name) for name in "abcdefgh"], repeat_flagged=True), 0
    while (planned := order.next_trial()) is not None:
        flag = TrialFlag.DROPPED_FRAMES if flags[min(n, len(flags) - 1)] == "x" else TrialFlag.NONE
        order.take(SimpleNamespace(flag=flag, trial_index=n, participant_id="01", block=planned.block))
        n += 1
    return n


def test_nothing_is_shown_again_where_every_showing_was_flagged() -> None:
    """Of 8 a quarter, 2, come again where one at least was shown as it should be."""
    assert showings("x") == 8
    assert showings(".x") == 10


def test_one_flagged_showing_may_be_a_hiccup_and_is_repeated() -> None:
    order = FixedOrder([clip("a")], repeat_flagged=True)
    for block in (1, 2):
        assert order.n_left == 1
        flagged = {"flag": TrialFlag.DROPPED_FRAMES, "block": block}
        order.take(SimpleNamespace(**flagged, trial_index=0, participant_id="01"))
    assert order.next_trial() is None


def test_a_resumed_session_that_is_interrupted_tells_what_is_stored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Before its window is open nothing was reported yet; twelve whole lines are there, and a torn one."""
    folder = session_folder(tmp_path, "01", "01")
    folder.mkdir(parents=True)
    (folder / TRIALS).write_text("{}\n" * 12 + '{"torn')

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(run_session, "run_session", interrupted)
    request = SimpleNamespace(
        dataset=tmp_path, participant_id="01", session_id="01", staging=SimpleNamespace(simulated=True)
    )
    with pytest.raises(SystemExit):
        run_command._run_session(request, quiet=True)  # type: ignore[arg-type] # of a request only these
    assert "interrupted after 12 trials; all of them are safe" in capsys.readouterr().err
