"""The roll-call of a data set: every session is read, or it is said why not; a copy counts once."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.roll_call import RollCall, SessionUse, call_roll

FEW = 4  # trials of a session


def session(dataset: Path, who: str, visit: str = "01", **manifest: object) -> Path:
    """A session as far as the roll-call looks at it; its times are those of no other."""
    folder = dataset / f"sub-{who}" / f"ses-{visit}"
    folder.mkdir(parents=True)
    ids = {"participant_id": who, "session_id": visit}
    text = json.dumps({**ids, "task": "ramp", "status": "complete", **manifest})
    (folder / "manifest.json").write_text(text)
    times = [int(who) + int(visit) / 10 + n / 1000 for n in range(FEW)]
    lines = [{**ids, "trial_index": n, "response_time_s": time} for n, time in enumerate(times)]
    (folder / "trials.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    return folder


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    """Three participants with a session each."""
    root = tmp_path / "lab"
    for who in ("01", "02", "03"):
        session(root, who)
    (root / "participants.tsv").write_text(
        "participant_id\tsimulated\nsub-01\ttrue\nsub-02\ttrue\nsub-03\ttrue\n"
    )
    return root


def rewrite(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def left_out(roll: RollCall) -> dict[str, SessionUse]:
    return {entry.folder: entry.use for entry in roll.sessions if entry.use is not SessionUse.READ}


def test_a_sound_data_set_is_read_whole_and_nothing_is_said(dataset: Path) -> None:
    roll = call_roll(dataset)
    assert [entry.folder for entry in roll.read] == [f"sub-0{n}/ses-01" for n in (1, 2, 3)]
    assert [(e.participant_id, e.session_id, e.task, e.status, e.n_trials) for e in roll.sessions][1] == (
        "02", "01", "ramp", "complete", FEW,
    )  # fmt: skip
    assert (roll.dataset, roll.listed, roll.tasks, roll.warnings) == (
        "lab",
        ("01", "02", "03"),
        ("ramp",),
        (),
    )


S = "sub-02/ses-01"
DAMAGES: dict[str, tuple[Callable[[Path], object], str, SessionUse, str]] = {
    "no trial in it": (
        lambda d: (d / S / "trials.jsonl").write_text("\n"),
        S, SessionUse.WRONG, "it has no trial (status: complete)",
    ),
    "no file of trials, only begun": (
        lambda d: [
            (d / S / "trials.jsonl").unlink(), rewrite(d / S / "manifest.json", "complete", "running"),
        ],
        S, SessionUse.LEFT_OUT, "it has no trial (status: running)",
    ),
    "a status of a later version, no trial": (
        lambda d: [
            (d / S / "trials.jsonl").unlink(), rewrite(d / S / "manifest.json", "complete", "imported"),
        ],
        S, SessionUse.WRONG, "it has no trial (status: imported)",
    ),
    "declined": (
        lambda d: rewrite(d / S / "manifest.json", "complete", "declined"),
        S, SessionUse.LEFT_OUT, "the participant declined",
    ),
    "an empty folder": (
        lambda d: [path.unlink() for path in (d / S).iterdir()],
        S, SessionUse.LEFT_OUT, "it holds no manifest.json and no trial",
    ),
    "a participant without sessions": (
        lambda d: shutil.rmtree(d / S), "sub-02", SessionUse.LEFT_OUT, "it holds no session folder (ses-*)",
    ),
    "a task in capitals": (
        lambda d: rewrite(d / S / "manifest.json", '"ramp"', '"Ramp"'),
        S, SessionUse.WRONG, "manifest.json: task: expected 'ramp', got 'Ramp'",
    ),
    "an unknown task": (
        lambda d: rewrite(d / S / "manifest.json", '"ramp"', '"juggling"'),
        S, SessionUse.LEFT_OUT, "its task 'juggling' is none of ramp, rating, comparison, search",
    ),
    "a task that is no text": (
        lambda d: rewrite(d / S / "manifest.json", '"ramp"', "7"),
        S, SessionUse.WRONG, "manifest.json: task: got 7",
    ),
    "a participant's folder in capitals": (
        lambda d: (d / "sub-02").rename(d / "Sub-02"),
        "Sub-02", SessionUse.WRONG, "its name is not sub- with letters and digits after it",
    ),
    "a participant's folder of any other name": (
        lambda d: (d / "sub-02").rename(d / "second"),
        "second", SessionUse.WRONG, "its name is not sub- with letters and digits after it",
    ),
    "a session's folder with a blank": (
        lambda d: (d / S).rename(d / "sub-02" / "ses-01 old"),
        "sub-02/ses-01 old", SessionUse.WRONG, "its name is not ses- with letters and digits after it",
    ),
    "no manifest": (
        lambda d: (d / S / "manifest.json").unlink(),
        S, SessionUse.DAMAGED, "holds trials.jsonl but no manifest.json; restore the manifest",
    ),
    "a torn manifest": (
        lambda d: (d / S / "manifest.json").write_text("{"),
        S, SessionUse.DAMAGED, "manifest.json: not valid JSON",
    ),
    "a manifest that is a list": (
        lambda d: (d / S / "manifest.json").write_text("[]"),
        S, SessionUse.DAMAGED, "manifest.json: expected names and values, got a list",
    ),
    "trials that are no text": (
        lambda d: (d / S / "trials.jsonl").write_bytes(b"\xff\xfe"),
        S, SessionUse.DAMAGED, "trials.jsonl: is not text",
    ),
}  # fmt: skip


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_session_that_is_not_read_is_named_with_the_reason_and_the_others_are_read(
    damage: str, dataset: Path
) -> None:
    act, folder, use, why = DAMAGES[damage]
    act(dataset)
    roll = call_roll(dataset)
    assert left_out(roll) == {folder: use}
    assert any(said.startswith(f"{folder} is left out: {why}") for said in roll.warnings), roll.warnings
    assert [entry.folder for entry in roll.read] == ["sub-01/ses-01", "sub-03/ses-01"]


def test_a_folder_that_is_gone_or_not_listed_is_named(dataset: Path) -> None:
    shutil.rmtree(dataset / "sub-02")
    session(dataset, "07")
    assert call_roll(dataset).warnings == (
        "without a session, though participants.tsv lists them: sub-02",
        "not listed in participants.tsv: sub-07",
    )


@pytest.mark.parametrize("text", ["name\nsub-01\n", "participant_id\nAnna\n", ""])
def test_a_list_of_something_else_stops_nobody_and_no_name_of_it_is_told(text: str, dataset: Path) -> None:
    (dataset / "participants.tsv").write_text(text)
    roll = call_roll(dataset)
    assert len(roll.read) == 3
    assert roll.listed == ()
    assert roll.warnings == (
        "participants.tsv is no list of participant_id and sub-XX; `evenlight validate` says where",
    )


@pytest.mark.parametrize("copy", ["sub-04", "sub-00"])  # after the original, and before it
def test_of_a_copied_folder_the_one_that_agrees_with_its_manifest_is_read(copy: str, dataset: Path) -> None:
    shutil.copytree(dataset / "sub-02", dataset / copy)
    roll = call_roll(dataset)
    assert left_out(roll) == {f"{copy}/ses-01": SessionUse.WRONG}
    assert f"{copy}/ses-01 is left out: its trials are those of {S}; a copy counts once" in roll.warnings


def test_a_copy_under_another_participant_counts_once_though_all_its_ids_are_rewritten(dataset: Path) -> None:
    shutil.copytree(dataset / "sub-02", dataset / "sub-04")
    for path in (dataset / "sub-04/ses-01").iterdir():
        rewrite(path, '"participant_id": "02"', '"participant_id": "04"')
    assert left_out(call_roll(dataset)) == {"sub-04/ses-01": SessionUse.WRONG}


def test_a_copy_whose_trials_were_edited_is_still_the_same_session(dataset: Path) -> None:
    shutil.copytree(dataset / "sub-02", dataset / "sub-04")
    lines = (dataset / "sub-04/ses-01/trials.jsonl").read_text().splitlines()
    (dataset / "sub-04/ses-01/trials.jsonl").write_text("\n".join(lines[:-1]) + "\n")
    roll = call_roll(dataset)
    assert left_out(roll) == {"sub-04/ses-01": SessionUse.WRONG}
    assert any(f"it is session 01 of participant 02, which {S} is" in said for said in roll.warnings)


def test_a_renamed_folder_is_read_as_its_manifest_says_and_that_is_said(dataset: Path) -> None:
    (dataset / "sub-02").rename(dataset / "sub-05")
    roll = call_roll(dataset)
    assert [entry.participant_id for entry in roll.read] == ["01", "03", "02"]
    assert "sub-05/ses-01 is read as session 01 of participant 02, as its manifest.json says" in roll.warnings


@pytest.mark.parametrize("times", [(None, None, None, None), (0.7, 0.7, 0.7, 0.7)])
def test_a_few_equal_answers_of_two_people_are_no_copy(
    times: tuple[float | None, ...], dataset: Path
) -> None:
    """Two people may give the same four ratings; nobody needs the same milliseconds three times."""
    for who in ("01", "02"):
        lines = [
            {"participant_id": who, "session_id": "01", "rating": 5, "response_time_s": t} for t in times
        ]
        path = dataset / f"sub-{who}/ses-01/trials.jsonl"
        path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    assert left_out(call_roll(dataset)) == {}


def test_a_link_out_of_the_data_set_is_said_and_a_broken_one_stops_nobody(
    dataset: Path, tmp_path: Path
) -> None:
    (dataset / "sub-02").rename(tmp_path / "elsewhere")
    (dataset / "sub-02").symlink_to(tmp_path / "elsewhere")
    assert call_roll(dataset).warnings == (
        f"{S} is a link out of the data set; it is read, and not exported",
    )
    shutil.rmtree(tmp_path / "elsewhere")
    assert left_out(call_roll(dataset)) == {"sub-02": SessionUse.LEFT_OUT}


@pytest.mark.parametrize("line", ["[" * 9999, "7", '{"response_time_s": []}', '{"response_time_s": NaN}'])
def test_lines_that_are_no_trials_are_left_to_the_reader(line: str, dataset: Path) -> None:
    (dataset / S / "trials.jsonl").write_text(f"{line}\n")
    assert left_out(call_roll(dataset)) == {}


def test_a_circle_of_links_stops_nobody(dataset: Path) -> None:
    (dataset / S / "trials.jsonl").unlink()
    (dataset / S / "trials.jsonl").symlink_to(dataset / S / "trials.jsonl")
    assert list(left_out(call_roll(dataset))) == [S]


def test_other_folders_of_a_data_set_are_no_sessions(dataset: Path) -> None:
    for name in ("sweeps/luminance-sweep_01", "stimuli/gym", "code", ".git/sub-01/ses-01", "submission"):
        (dataset / name).mkdir(parents=True)
    assert len(call_roll(dataset).sessions) == 3
    with pytest.raises(InputError, match="no such folder; expected a data set"):
        call_roll(dataset / "nowhere")
