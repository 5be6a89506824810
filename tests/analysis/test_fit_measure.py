"""The script that fits the measure of loss to ratings: it recovers what simulated raters go by."""

import importlib.util
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_ratings import rating_trial

import evenlight
from evenlight.data_schema.contrast_model import ContrastModel
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import sha256_of_file
from evenlight.data_schema.recordings.viewing import Stimulus, Version
from evenlight.data_schema.tracks.brightness_track import read_track
from evenlight.data_schema.tracks.loss_curves import read_loss_curves
from evenlight.method.contrast.contrast_loss import contrast_loss
from evenlight.method.contrast.luminance import emitted_luminance
from evenlight.stimuli.sequences import built_in_sequence
from evenlight.stimuli.video_writer import write_video

PATH = Path(__file__).parents[2] / "examples" / "fit_measure.py"
SPEC = importlib.util.spec_from_file_location("fit_measure", PATH)
script = importlib.util.module_from_spec(SPEC)
sys.modules["fit_measure"] = script
SPEC.loader.exec_module(script)

SEQUENCES = tuple(f"s{k}" for k in range(6))
CANDIDATES = script.measure_candidates()[:8]
CUTS = np.array([-3.0, -1.5, 0.0, 1.5])


def drawn_losses(rng):
    """Losses that candidates differ on: of constant dimming 0.02 to 0.1, of ours about a quarter less."""
    losses = {}
    for name in SEQUENCES:
        constant = rng.uniform(0.02, 0.1) * np.exp(0.4 * rng.normal(size=len(CANDIDATES)))
        losses[name, Version.BASELINE] = constant
        losses[name, Version.OURS] = constant * rng.uniform(0.3, 1.1, size=len(CANDIDATES))
    return losses


def drawn_ratings(rng, losses, truth, people=30, strength=2.0):
    """Ratings by the losses of one candidate, on a logistic scale; orders alternate."""
    unit = np.std([loss[truth] for loss in losses.values()])
    trials = []
    for person in range(people):
        level = rng.normal()
        for number, name in enumerate(SEQUENCES):
            ours_first = (person + number) % 2 == 0
            for version in Version:
                scale = level + number / 3 - strength * losses[name, version][truth] / unit
                rating = 1 + int(np.sum(scale + rng.logistic() > CUTS))
                place = 1 if (version is Version.OURS) == ours_first else 2
                trials.append(rating_trial(f"{person:03}", name, version, rating, place))
    return trials


def test_the_measure_that_raters_go_by_is_recovered():
    rng = np.random.default_rng(5)
    held, best, excluded = 0, 0, 0
    for _ in range(12):
        losses, truth = drawn_losses(rng), int(rng.integers(len(CANDIDATES)))
        table, _, _ = script.fit_measure(drawn_ratings(rng, losses, truth), losses, CANDIDATES)
        held += CANDIDATES[truth] in list(table.candidate[table.possible])
        best += table.candidate[0] == CANDIDATES[truth]
        excluded += int((~table.possible).sum())
    # 95 % sets: at most 9 of 12 has a probability of 2 %. By chance the best would be right in 1.5 of 12.
    assert held >= 10
    assert best >= 6
    assert excluded >= 12 * 2


def test_raters_who_go_by_no_loss_leave_all_measures_possible():
    rng = np.random.default_rng(6)
    losses = drawn_losses(rng)
    table, p_of_loss, _ = script.fit_measure(drawn_ratings(rng, losses, 0, strength=0.0), losses, CANDIDATES)
    assert p_of_loss > 0.05
    assert table.possible.all()


def test_what_no_measure_explains_is_found():
    # Ours is rated higher in three sequences and lower in three, whatever is lost.
    rng = np.random.default_rng(7)
    losses = {key: np.full(8, 0.02 if key[1] is Version.OURS else 0.04) for key in drawn_losses(rng)}
    moved = {
        key: loss * (1.5 if int(key[0][1]) < 3 and key[1] is Version.BASELINE else 0.5)
        for key, loss in losses.items()
    }
    odd = {key: (0.06 - loss if int(key[0][1]) >= 3 else loss) for key, loss in moved.items()}
    _, _, p_of_the_rest = script.fit_measure(drawn_ratings(rng, odd, 0), losses, CANDIDATES)
    assert p_of_the_rest < 0.01


def test_one_sequence_tells_nothing():
    trials = [rating_trial("01", "s0", version, 3) for version in Version]
    losses = {("s0", version): np.full(8, 0.1) for version in Version}
    with pytest.raises(InputError, match="of one sequence"):
        script.fit_measure(trials, losses, CANDIDATES)


def test_ratings_of_a_slider_are_to_be_rounded_first():
    trials = [rating_trial("01", f"s{k % 2}", version, 5 * k) for k in range(12) for version in Version]
    losses = {(f"s{k}", version): np.full(8, 0.1) for k in range(2) for version in Version}
    with pytest.raises(InputError, match="more than 11 different ratings"):
        script.fit_measure(trials, losses, CANDIDATES)


@pytest.fixture(scope="module")
def stimuli(tmp_path_factory) -> Path:
    """A small sequence with its track."""
    folder = tmp_path_factory.mktemp("stimuli") / "s0"
    video = folder.with_suffix(".mkv")
    write_video(video, built_in_sequence("sunrise", (64, 36), 2.0, 5.0).frames(), 5.0, field_of_view=90.0)
    evenlight.optimize(video, 0.5).save(folder)
    video.rename(folder / "video.mkv")
    return folder.parent


def test_losses_of_what_was_shown_are_those_of_the_definition(stimuli):
    models = (ContrastModel(), ContrastModel(lowest_frequency=1.0, threshold=2.0, masking_strength=0.0))
    found = script.condition_losses(stimuli, {"s0": None}, [script.Candidate("", m, 4.0) for m in models])
    folder, frames = stimuli / "s0", list(built_in_sequence("sunrise", (64, 36), 2.0, 5.0).frames())
    display, factors = (
        read_loss_curves(folder / "loss_curves.npz").display,
        read_track(folder / "track.csv").factors,
    )
    for k, model in enumerate(models):
        defined = [
            contrast_loss(emitted_luminance(frame.pixel_values, display), factor, display, model)
            for frame, factor in zip(frames, factors, strict=True)
        ]
        assert found["s0", Version.OURS][k] == pytest.approx(script.pooled(np.array(defined), 4.0), abs=1e-3)
    assert len(set(np.round(found["s0", Version.BASELINE], 4))) == 2  # the models do differ


def test_a_folder_without_the_rated_sequences_says_what_it_must_hold(tmp_path):
    with pytest.raises(InputError, match="holds no folder s0, s1; give the folder of the rated stimuli"):
        script.condition_losses(tmp_path, {"s0": None, "s1": None}, CANDIDATES)


def test_other_stimuli_than_those_shown_are_refused(stimuli):
    folder = stimuli / "s0"
    shown = Stimulus("s0", sha256_of_file(folder / "video.mkv"), "0" * 64, 10, 2.0, 0.5, 0.5)
    with pytest.raises(InputError, match=r"track\.csv: is not what the sessions showed"):
        script.stimulus_losses(folder, shown, [ContrastModel()])
    right = replace(shown, track_sha256=sha256_of_file(folder / "track.csv"))
    assert set(script.stimulus_losses(folder, right, [ContrastModel()])) == set(Version)
