"""The fit of the measure of loss to ratings: recovered from simulated raters, honest about what it knows."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_ratings import rating_data, rating_trial

import evenlight
from evenlight.analysis.findings import write_findings
from evenlight.analysis.rating import measure_findings as measure_findings_module
from evenlight.analysis.rating.measure_candidates import (
    MeasureCandidate,
    condition_losses,
    measure_candidates,
    pooled,
    rated_stimuli,
)
from evenlight.analysis.rating.measure_findings import measure_findings
from evenlight.analysis.rating.measure_fit import fit_measure
from evenlight.data_schema.contrast_model import ContrastModel
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import sha256_of_file
from evenlight.data_schema.recordings.viewing import Stimulus, Version
from evenlight.method.contrast.contrast_loss import contrast_loss
from evenlight.method.contrast.luminance import emitted_luminance
from evenlight.method.preset_files import load_contrast_model
from evenlight.stimuli.sequences import built_in_sequence
from evenlight.stimuli.video.video_writer import write_video

SEQUENCES = tuple(f"s{k}" for k in range(6))
CANDIDATES = measure_candidates()[:8]
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
        fit = fit_measure(drawn_ratings(rng, losses, truth), losses, CANDIDATES)
        held += CANDIDATES[truth] in [own.candidate for own in fit.possible]
        best += fit.best.candidate == CANDIDATES[truth]
        excluded += len(CANDIDATES) - len(fit.possible)
    # 95 % sets: at most 9 of 12 has a probability of 2 %. By chance the best would be right in 1.5 of 12.
    assert held >= 10
    assert best >= 6
    assert excluded >= 12 * 2


def test_raters_who_go_by_no_loss_leave_all_measures_possible():
    rng = np.random.default_rng(6)
    losses = drawn_losses(rng)
    fit = fit_measure(drawn_ratings(rng, losses, 0, strength=0.0), losses, CANDIDATES)
    assert fit.p_of_loss > 0.05
    assert len(fit.possible) == len(CANDIDATES)


def test_what_no_measure_explains_is_found():
    # Ours is rated higher in three sequences and lower in three, whatever is lost.
    rng = np.random.default_rng(7)
    losses = {key: np.full(8, 0.02 if key[1] is Version.OURS else 0.04) for key in drawn_losses(rng)}
    moved = {
        key: loss * (1.5 if int(key[0][1]) < 3 and key[1] is Version.BASELINE else 0.5)
        for key, loss in losses.items()
    }
    odd = {key: (0.06 - loss if int(key[0][1]) >= 3 else loss) for key, loss in moved.items()}
    fit = fit_measure(drawn_ratings(rng, odd, 0), losses, CANDIDATES)
    assert fit.p_of_the_rest < 0.01


def test_one_sequence_tells_nothing():
    trials = [rating_trial("01", "s0", version, 3) for version in Version]
    losses = {("s0", version): np.full(8, 0.1) for version in Version}
    with pytest.raises(InputError, match="of one sequence"):
        fit_measure(trials, losses, CANDIDATES)


@pytest.fixture(scope="module")
def stimuli(tmp_path_factory) -> Path:
    """Two small sequences with their tracks."""
    folder = tmp_path_factory.mktemp("stimuli")
    for name, kind in (("s0", "sunrise"), ("s1", "checkerboard")):
        source = built_in_sequence(kind, (64, 36), 2.0, 5.0)
        (folder / name).mkdir()
        write_video(folder / name / "video.mkv", source.frames(), 5.0, field_of_view=90.0)
        evenlight.optimize(folder / name / "video.mkv", 0.5).save(folder / name)
    return folder


def test_losses_of_what_was_shown_are_those_of_the_definition(stimuli):
    models = (ContrastModel(), ContrastModel(lowest_frequency=1.0, threshold=2.0, masking_strength=0.0))
    known = rated_stimuli(stimuli, {"s0": None})
    candidates = [MeasureCandidate("", model, 4.0) for model in models]
    found = condition_losses(known, candidates)
    stimulus = known["s0"]
    display = stimulus.curves.display
    for version, factors in stimulus.factors.items():
        for k, model in enumerate(models):
            defined = [
                contrast_loss(emitted_luminance(frame.pixel_values, display), factors[number], display, model)
                for number, frame in stimulus.sampled()
            ]
            assert found["s0", version][k] == pytest.approx(pooled(np.array(defined), 4.0), abs=1e-3)
    assert len(set(np.round(found["s0", Version.BASELINE], 4))) == 2  # the models do differ


def found_with(stimuli, rating_of):
    rated = []
    for who in range(12):
        for name in ("s0", "s1"):
            for version in Version:
                place = 1 + (who + (version is Version.OURS)) % 2
                rated.append(rating_trial(f"{who:02}", name, version, rating_of(who, version), place))
    return measure_findings(rating_data(rated, ("s0", "s1")), stimuli)


@pytest.fixture
def few_candidates(monkeypatch):
    monkeypatch.setattr(measure_findings_module, "measure_candidates", lambda: CANDIDATES)


def test_ratings_that_say_nothing_give_no_other_measure(stimuli, tmp_path, few_candidates):
    rng = np.random.default_rng(8)
    findings = found_with(stimuli, lambda who, version: int(rng.integers(1, 6)))
    write_findings(tmp_path, findings)
    assert not list(tmp_path.glob("*.toml"))
    assert "simulated" in findings.lead
    told = {statistic.group for statistic in findings.statistics if statistic.table == "candidates"}
    assert len(told) == len(CANDIDATES)


def test_a_measure_that_ratings_rather_speak_for_comes_as_a_preset(
    stimuli, tmp_path, monkeypatch, few_candidates
):
    def losses(known, _):
        # By the second, and by no other, ours loses less.
        found = {}
        for name in known:
            for version in Version:
                way = 1 if version is Version.OURS else -1
                found[name, version] = np.full(len(CANDIDATES), 0.1 + 0.05 * way * (1 + (name == "s1")))
                found[name, version][1] = 0.1 - 0.05 * way
        return found

    monkeypatch.setattr(measure_findings_module, "condition_losses", losses)
    findings = found_with(stimuli, lambda who, v: 3 + who % 3 - (v is Version.BASELINE) * (1 + who % 2))
    write_findings(tmp_path, findings)
    assert load_contrast_model(str(tmp_path / "fitted.contrast_model.toml")) == CANDIDATES[1].model


def test_a_folder_without_the_rated_sequences_says_what_it_must_hold(tmp_path):
    with pytest.raises(InputError, match="holds no folder s0, s1; give the folder of the rated stimuli"):
        rated_stimuli(tmp_path, {"s0": None, "s1": None})


def test_other_stimuli_than_those_shown_are_refused(stimuli):
    folder = stimuli / "s0"
    shown = Stimulus("s0", sha256_of_file(folder / "video.mkv"), "0" * 64, 10, 2.0, 0.5, 0.5)
    with pytest.raises(InputError, match=r"track\.csv: is not what the sessions showed"):
        rated_stimuli(stimuli, {"s0": shown})
    right = replace(shown, track_sha256=sha256_of_file(folder / "track.csv"))
    assert set(rated_stimuli(stimuli, {"s0": right})) == {"s0"}
