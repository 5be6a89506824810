"""What a viewing session is refused for: one line that says what is wrong, and what was answered is kept."""

import contextlib
import dataclasses
import json
import os
import re
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from warm_evenlight import Run

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.recordings.viewing import RatingDesign, Version
from evenlight.data_schema.storage.text_files import write_toml_record
from evenlight.experiments.run_session import session_notes
from evenlight.experiments.stimulus_folder import LoadedStimulus, as_searched, load_stimuli
from evenlight.experiments.viewing.viewing_task import stimulus_clip
from evenlight.hardware.rig_files import load_rig
from evenlight.method.preset_files import load_display
from evenlight.stimuli.video_writer import write_video

NAMES = ("bright", "dark")
N = 10


@pytest.fixture
def stimuli(tmp_path: Path, make_stimulus: Callable[..., None], make_video: Callable[..., None]) -> Path:
    folder = tmp_path / "stimuli"
    for name in NAMES:
        make_stimulus(folder / name, np.full(N, 0.5))
        make_video(folder / name / "video.mkv", np.linspace(0.3, 0.6, N), (96, 64), 5.0)
    return folder


@pytest.fixture
def design(tmp_path: Path) -> Path:
    path = tmp_path / "my.rating.design.toml"
    write_toml_record(path, RatingDesign(NAMES, practice_trials=0, adaptation_duration=0.1))
    return path


@pytest.fixture
def run(tmp_path: Path, design: Path, command: Callable[..., Any]) -> Callable[..., Any]:
    def session(task: str, *more: object, rig: object = "simulated") -> Any:
        words = ["--participant", "01", "--session", "01", "--rig", rig, "--simulate", "data"]
        chosen = [] if "--design" in more else ["--design", design]
        return command("run", task, *words, *chosen, "--out", tmp_path / "lab", *more)

    return session


def refused(outcome: Any, *words: str) -> None:
    assert outcome.code == 2
    assert outcome.err.count("\n") == 1
    for word in words:
        assert word in outcome.err


def test_a_viewing_session_without_stimuli_names_the_sequences_it_needs(run: Callable[..., Any]) -> None:
    refused(run("rating"), "--stimuli is missing", "bright, dark", "evenlight optimize")


def test_a_folder_that_is_not_there_or_lacks_a_sequence_says_how_to_make_it(
    run: Callable[..., Any], stimuli: Path, tmp_path: Path
) -> None:
    refused(run("rating", "--stimuli", tmp_path / "none"), "no such folder of stimuli")
    shutil.rmtree(stimuli / "dark")
    refused(run("rating", "--stimuli", stimuli), "dark/track.csv: no such file", "evenlight optimize dark")
    assert not (tmp_path / "lab").exists()


def test_a_ramp_session_takes_no_stimuli(run: Callable[..., Any], stimuli: Path) -> None:
    refused(
        run("ramp", "--stimuli", stimuli, "--design", "quick"), "--stimuli is for the viewing experiments"
    )


def test_a_track_that_was_made_for_another_display_is_refused(
    run: Callable[..., Any], stimuli: Path, tmp_path: Path
) -> None:
    other = dataclasses.replace(load_display("varjo-xr3"), name="bench", peak_luminance=300.0)
    write_toml_record(tmp_path / "bench.display.toml", other)
    rig = dataclasses.replace(load_rig("simulated")[0], display="bench.display.toml")
    write_toml_record(tmp_path / "bench.rig.toml", rig)
    refused(run("rating", "--stimuli", stimuli, rig=tmp_path / "bench.rig.toml"), "'varjo-xr3'", "'bench'")


def test_a_stimulus_is_shown_at_the_angle_its_track_was_made_for_or_refused(stimuli: Path) -> None:
    """96 pixels of 90 degrees have 48 tan 1 of them per degree in their middle, and the display 72.28."""
    display = load_display("varjo-xr3")

    def loaded(**known: float | None) -> LoadedStimulus:
        for name in NAMES:
            header = stimuli / name / "track.json"
            header.write_text(json.dumps(json.loads(header.read_text()) | known))
        return load_stimuli(stimuli, NAMES, display, with_video=True)[0]

    wide = loaded(field_of_view_deg=90.0, pixels_per_degree=48 * np.radians(1))
    assert wide.stimulus.pixels_per_degree == pytest.approx(48 * np.radians(1))
    assert stimulus_clip(wide, Version.OURS, 1, None).scale == pytest.approx(72.28 / (48 * np.radians(1)))
    plain = loaded(field_of_view_deg=None, pixels_per_degree=72.28)
    assert plain.stimulus.pixels_per_degree == 72.28
    assert stimulus_clip(plain, Version.OURS, 1, None).scale is None
    with pytest.raises(InputError, match="bright: the track was made for a video seen at 38 pixels"):
        loaded(field_of_view_deg=None, pixels_per_degree=38.0)


@pytest.mark.parametrize(
    ("angle", "video", "says"),
    [
        (90.0, None, ""),
        (91.0, None, ""),
        (17.0, 17.0, ""),  # rendered for a monitor
        (90.0, 17.0, ""),
        (None, None, "was made pixel for pixel, and the search shows the path at its true size, 90° wide"),
        (40.0, None, "was made at 40°, and"),
        (40.0, 17.0, "90° or 17° wide; make it again with `evenlight optimize library --budget B"),
    ],
)
def test_a_search_takes_tracks_made_at_true_size(
    tmp_path: Path,
    make_stimulus: Callable[..., None],
    angle: float | None,
    video: float | None,
    says: str,
) -> None:
    folder = tmp_path / "library"
    make_stimulus(folder, np.full(2, 0.5))
    header = folder / "track.json"
    header.write_text(json.dumps(json.loads(header.read_text()) | {"field_of_view_deg": angle}))
    if video is not None:
        frames = (Frame(0.2 * k, 0.2, np.zeros((16, 16, 3), np.uint8)) for k in range(2))
        write_video(folder / "video.mkv", frames, 5.0, field_of_view=video)
    loaded = load_stimuli(tmp_path, ["library"], load_display("varjo-xr3"), with_video=False)
    with pytest.raises(InputError, match=says) if says else contextlib.nullcontext():
        assert as_searched(loaded)[0].stimulus.video_sha256


def test_a_session_on_pixels_says_what_a_track_for_a_backlight_does_not_count(
    stimuli: Path,
) -> None:
    header = stimuli / "dark" / "track.json"
    header.write_text(json.dumps(json.loads(header.read_text()) | {"loss_added_by_pixels": 0.02}))
    loaded = load_stimuli(stimuli, NAMES, load_display("varjo-xr3"), with_video=False)
    rig = load_rig("simulated")[0]
    (said,) = session_notes(loaded, rig, (640, 480))
    assert "the track of dark was made for a backlight" in said
    assert not list(session_notes(loaded, rig, None))  # nothing is shown


def test_a_session_goes_on_only_with_the_stimuli_it_began_with(
    run: Callable[..., Any], stimuli: Path, make_stimulus: Callable[..., None], tmp_path: Path
) -> None:
    assert run("rating", "--stimuli", stimuli).code == 0
    manifest = tmp_path / "lab/sub-01/ses-01/manifest.json"
    manifest.write_text(manifest.read_text().replace('"status": "complete"', '"status": "aborted"'))
    make_stimulus(stimuli / "dark", np.full(N, 0.4))
    refused(run("rating", "--stimuli", stimuli, "--resume"), "--stimuli is not as it was")
    other = ("--stimuli", stimuli, "--resume", "--design", "quick")
    refused(run("comparison", *other), "of the task 'rating', not 'comparison'")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('keypoints = ["library/attic"]', ("'library/attic'", "stacks")),
        ("ring_gap_arcmin = 1.0", ("1.20 pixels", "2 or more", "arcmin or more")),
        ("ring_contrast = -0.99", ("at the keypoint library/", "give a contrast from")),
        ('keypoints = ["gym/court"]', ("is on none of the sequences library",)),
    ],
)
def test_a_search_that_cannot_be_shown_is_refused_before_it_begins(
    run: Callable[..., Any],
    make_stimulus: Callable[..., None],
    tmp_path: Path,
    text: str,
    words: tuple[str, ...],
) -> None:
    make_stimulus(tmp_path / "walks" / "library", np.full(375, 0.5))  # 75 s, as long as the path
    path = tmp_path / "my.search.design.toml"
    path.write_text(f'sequences = ["library"]\n{text}\n')
    refused(run("search", "--stimuli", tmp_path / "walks", "--design", path), *words)
    assert not (tmp_path / "lab").exists()


def test_a_track_that_ends_before_its_path_is_refused(
    run: Callable[..., Any], make_stimulus: Callable[..., None], tmp_path: Path
) -> None:
    make_stimulus(tmp_path / "walks" / "library", np.full(100, 0.5))  # 20 of 75 s
    path = tmp_path / "my.search.design.toml"
    path.write_text('sequences = ["library"]\n')
    outcome = run("search", "--stimuli", tmp_path / "walks", "--design", path)
    refused(outcome, "its track lasts 20 s, and the path library 75 s")


class Screen:
    """Sessions in processes of their own, on a virtual screen."""

    def __init__(self, folder: Path, rig: Path, display: str) -> None:
        self._folder, self._rig = folder, rig
        self._environment = os.environ | {"DISPLAY": display}

    def start(self, stimuli: Path, design: Path, *more: str) -> Run:
        words = ["--participant", "01", "--session", "01", "--rig", self._rig, "--simulate", "visual"]
        words += ["--stimuli", stimuli, "--design", design, "--out", self._folder / "lab", *more]
        return Run(["run", "rating", *map(str, words)], self._environment)

    def run(self, stimuli: Path, design: Path, *more: str) -> tuple[int | None, str]:
        """Run a session; return its exit code, and what it said on standard error."""
        process = self.start(stimuli, design, *more)
        _, err = process.communicate(timeout=200)
        return process.returncode, err


@pytest.fixture
def screen(tmp_path: Path, small_rig: Path, virtual_screen: Callable[..., str]) -> Screen:
    return Screen(tmp_path, small_rig, virtual_screen())


def test_a_track_of_another_video_than_the_one_that_is_shown_is_refused(
    screen: Screen, stimuli: Path, design: Path, tmp_path: Path
) -> None:
    """The same walk in another size has its details elsewhere on the visual field, and another loss."""
    header = stimuli / "dark" / "track.json"
    said = json.loads(header.read_text())
    said["provenance"]["inputs"] = {"video": "0" * 64}
    header.write_text(json.dumps(said))
    code, err = screen.run(stimuli, design)
    assert (code, err.count("\n")) == (2, 1)
    assert "the track was made from another video than video.mkv" in err
    assert not (tmp_path / "lab").exists()


def test_a_video_that_does_not_fit_track_or_window_is_refused_before_anybody_is_asked(
    screen: Screen, stimuli: Path, design: Path, make_video: Callable[..., None], tmp_path: Path
) -> None:
    video = stimuli / "dark" / "video.mkv"
    for made, words in (
        ((np.full(N - 2, 0.5), (96, 64), 5.0), f"{N - 2} frames, and its brightness track {N}"),
        ((np.full(N, 0.5), (96, 64), 10.0), "they must have one frame rate"),
        ((np.full(N, 0.5), (2000, 64), 5.0), "render it at --size"),
    ):
        make_video(video, *made)
        code, err = screen.run(stimuli, design)
        assert (code, err.count("\n")) == (2, 1)
        assert words in err
        assert not (tmp_path / "lab").exists()
    video.unlink()
    code, err = screen.run(stimuli, design)
    assert code == 2
    assert "holds no video; render it with `evenlight render dark" in err


def test_a_video_that_is_damaged_is_refused_before_anybody_is_asked(
    screen: Screen, stimuli: Path, design: Path, tmp_path: Path
) -> None:
    """A byte of its eighth frame is another, which the checksum of the frame tells."""
    spoil(stimuli / "dark" / "video.mkv", frame=7)
    code, err = screen.run(stimuli, design)
    assert (code, err.count("\n")) == (2, 1)
    assert "is damaged at frame 7" in err
    assert not (tmp_path / "lab").exists()


def test_a_video_that_breaks_in_mid_session_ends_it_with_one_line_and_keeps_what_was_answered(
    screen: Screen, stimuli: Path, tmp_path: Path
) -> None:
    """The file is cut off after some trials; once it is whole again, the session goes on."""
    long = tmp_path / "long.rating.design.toml"
    design = RatingDesign(NAMES, repetitions=3, practice_trials=0, adaptation_duration=0.1)
    write_toml_record(long, dataclasses.replace(design, trials_between_breaks=0))
    video, trials = stimuli / "dark" / "video.mkv", tmp_path / "lab/sub-01/ses-01/trials.jsonl"
    whole = video.read_bytes()
    session, end = screen.start(stimuli, long), time.monotonic() + 200
    while count(trials) < 3 and session.poll() is None and time.monotonic() < end:
        time.sleep(0.01)
    os.truncate(video, len(whole) // 2)  # at once: a file that is written again is empty for a moment
    _, err = session.communicate(timeout=200)
    assert (session.returncode, err.count("\n")) == (2, 1)
    # It was cut while it was shown, or before it was opened for the next trial of it.
    assert re.search(r"video\.mkv( is damaged|: it ends at byte \d+ of \d+)", err)
    answered = trials.read_text()
    assert 3 <= count(trials) < 12
    assert '"stopped"' in trials.with_name("events.jsonl").read_text()
    video.write_bytes(whole)
    assert screen.run(stimuli, long, "--resume")[0] == 0
    assert trials.read_text().startswith(answered)
    assert count(trials) == 12


def count(trials: Path) -> int:
    return trials.read_text().count("\n") if trials.exists() else 0


def spoil(video: Path, frame: int) -> None:
    """Change one byte in the middle of a frame, in place."""
    with av.open(video) as container:
        packet = [packet for packet in container.demux(video=0) if packet.size][frame]
        assert packet.pos is not None
        place = packet.pos + packet.size // 2
    with video.open("r+b") as file:
        file.seek(place)
        byte = file.read(1)[0]
        file.seek(place)
        file.write(bytes([byte ^ 0xFF]))
