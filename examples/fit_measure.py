"""Which measure of loss do ratings speak for? Fits the choices of the measure to the ratings of a study.

    python examples/fit_measure.py STUDY STIMULI --out measure

STUDY holds sessions of the task rating; STIMULI has a folder for each sequence that was rated, with its video
and what `evenlight optimize` wrote. The method, and how little a small study tells: docs/validity.md.
"""

import argparse
import itertools
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from evenlight.analysis.inference.cumulative_link import fit_ordinal, shown_effect
from evenlight.analysis.rating.rating_model import VERSION, is_linear, ordinal_data
from evenlight.analysis.session_loading import load_task
from evenlight.data_schema.contrast_model import DEFAULT_MODEL, ContrastModel
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import sha256_of_file
from evenlight.data_schema.recordings.viewing import RatingTrial, Version
from evenlight.data_schema.storage.text_files import read_json_record, write_toml_record
from evenlight.data_schema.tracks.brightness_track import read_track
from evenlight.data_schema.tracks.loss_curves import read_loss_curves
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary
from evenlight.method.contrast.measures import MEASURES
from evenlight.method.contrast.one_factor import OneFactorLoss
from evenlight.stimuli.sequences import open_video
from evenlight.stimuli.video.viewing_geometry import seen_video

# Lowest frequency [cpd]; threshold in multiples of the contrast that the CSF says; strength of masking.
GRID = ((0.5, 1.0, 2.0, 4.0), (0.5, 1.0, 2.0), (0.0, 1.0, 2.0))
POOLING = (1.0, 4.0)  # exponents of the mean over time; with 4 the worst moments count most (Quick 1974)
FREE_CHOICES = 4  # bands, threshold, masking, pooling
SAMPLED_FRAMES = 30  # of each video
VIDEOS = (".mkv", ".mp4", ".mov", ".avi", ".webm")


class Candidate(NamedTuple):
    """A measure of what dimming loses: its name, or "", its choices, the exponent of the mean over time."""

    name: str
    model: ContrastModel
    pooling: float

    @property
    def words(self) -> str:
        """What sets it apart."""
        own = self.model
        choices = f"from {own.lowest_frequency:g} cpd, threshold × {own.threshold:g}"
        words = self.name or f"{choices}, masking × {own.masking_strength:g}"
        return words if self.pooling == 1 else f"{words}; worst moments"


def measure_candidates() -> list[Candidate]:
    """Return all candidates, the paper's measure with the plain mean over time first."""
    names, grid = ("lowest_frequency", "threshold", "masking_strength"), itertools.product(*GRID)
    varied = [ContrastModel(**dict(zip(names, own, strict=True))) for own in grid]
    named = [*MEASURES.items(), *(("", model) for model in varied if model != DEFAULT_MODEL)]
    return [Candidate(name, model, power) for power in POOLING for name, model in named]


def pooled(losses: np.ndarray, exponent: float) -> float:
    """Return the mean over time of the losses of frames, by an exponent."""
    return float(np.mean(losses**exponent) ** (1 / exponent))


def shown_stimuli(data) -> dict:
    """Return the sequences that were rated, with what the sessions say they showed, or None."""
    shown = dict.fromkeys(trial.sequence for trial in data.trials)
    for session in data.sessions:
        for stimulus in session.manifest.stimuli:
            before = shown.get(stimulus.name)
            if before is not None and before.track_sha256 != stimulus.track_sha256:
                raise InputError(f"{session.folder}: another track of {stimulus.name} than before")
            if stimulus.name in shown:
                shown[stimulus.name] = stimulus
    return shown


def stimulus_losses(folder: Path, shown, models: list[ContrastModel]) -> dict[Version, np.ndarray]:
    """Return what each version of a sequence loses of sampled frames, by each model, (models, frames)."""
    track, curves = read_track(folder / "track.csv"), read_loss_curves(folder / "loss_curves.npz")
    summary = read_json_record(OptimizationSummary, folder / "summary.json")
    files = sorted(path for path in folder.iterdir() if path.suffix in VIDEOS)
    if len(files) != 1:
        raise InputError(f"{folder}: expected the one video that was rated, found {len(files)}")
    if shown is not None:
        for path, sha256 in ((folder / "track.csv", shown.track_sha256), (files[0], shown.video_sha256)):
            if sha256 and sha256_of_file(path) != sha256:
                raise InputError(f"{path}: is not what the sessions showed (SHA-256); give that one")
    video = open_video(str(files[0]))
    if not video.n_frames == len(track.factors) == curves.n_frames:
        raise InputError(f"{folder}: video, track and loss curves differ in length; `optimize` again")
    constant = np.full(len(track.factors), shown.baseline_factor if shown else summary.baseline_factor)
    factors = {Version.OURS: track.factors, Version.BASELINE: constant}
    lowest = float(min(own.min() for own in factors.values()))
    every = max(curves.n_frames // SAMPLED_FRAMES, 1)
    rows: dict[Version, list[list[float]]] = {version: [] for version in Version}
    frames, _ = seen_video(video.frames(), curves.display, curves.field_of_view or 0.0, video.name)
    measures: list[OneFactorLoss] = []
    for number, frame in enumerate(frames):
        if number % every == every // 2:
            pixels = frame.pixel_values
            if not measures:
                shape = pixels.shape[:2]
                measures = [OneFactorLoss(shape, curves.display, model, lowest) for model in models]
            for version, own in factors.items():
                rows[version].append([one.of(pixels, float(own[number])).loss for one in measures])
    return {version: np.array(table).T for version, table in rows.items()}


def condition_losses(stimuli: Path, shown: dict, candidates: list[Candidate]) -> dict:
    """Return what each candidate says that each version of each sequence loses, (candidates,) each."""
    if missing := [name for name in shown if not (stimuli / name).is_dir()]:
        raise InputError(
            f"{stimuli}: holds no folder {', '.join(missing)}; give the folder of the rated stimuli"
        )
    models, found = list(dict.fromkeys(own.model for own in candidates)), {}
    for name, stimulus in shown.items():
        print(f"what {name} loses, by each measure")
        for version, table in stimulus_losses(stimuli / name, stimulus, models).items():
            found[name, version] = np.array(
                [pooled(table[models.index(c.model)], c.pooling) for c in candidates]
            )
    return found


def fit_measure(
    trials: list[RatingTrial], losses: dict, candidates: list[Candidate]
) -> tuple[pd.DataFrame, float, float]:
    """Fit the ratings by each candidate, best first; p of no loss counting, and of nothing else counting.

    A candidate stays possible within chi-squared's 95 %, with as many degrees of freedom as choices, but no
    more than sequences less one: a measure's unit is free, so of n differences n - 1 ratios are told.
    """
    sequences = tuple(dict.fromkeys(trial.sequence for trial in trials))
    if len(sequences) < 2:
        raise InputError("the ratings are of one sequence: with two versions of it every measure fits alike")
    if is_linear(trials):
        raise InputError("more than 11 different ratings: this model is of ordered ratings; round them first")
    told = min(FREE_CHOICES, len(sequences) - 1)
    values = np.array([losses[trial.sequence, trial.version] for trial in trials])
    plain = ordinal_data(trials, sequences)
    others = [k for k, name in enumerate(plain.names) if name != VERSION]
    without = replace(plain, design=plain.design[:, others], names=tuple(plain.names[k] for k in others))
    rows = []
    for k, candidate in enumerate(candidates):
        unit = float(np.std([own[k] for own in losses.values()]))  # of the loss, over what was shown
        column = values[:, k] / unit if unit > 0 else np.zeros(len(trials))
        design = np.column_stack([column, without.design])
        fit = fit_ordinal(replace(without, design=design, names=("loss", *without.names)), profiled=())
        effect = shown_effect(fit, fit.effects[0])
        rows.append((candidate.words, likelihood(fit), effect.estimate, effect.p_value, candidate))
    top = max(row[1] for row in rows)
    none = likelihood(fit_ordinal(without, profiled=()))
    free = likelihood(fit_ordinal(ordinal_data(trials, sequences, interaction=True), profiled=()))
    table = pd.DataFrame(rows, columns=["measure", "log_likelihood", "effect", "p", "candidate"])
    table["possible"] = top - table.log_likelihood <= float(stats.chi2.ppf(0.95, told)) / 2
    table = table.sort_values("log_likelihood", ascending=False, kind="stable", ignore_index=True)
    gains = np.maximum([top - none, free - top], 0.0)
    return table, *stats.chi2.sf(2 * gains, [1 + told, len(sequences) - 1]).tolist()


def likelihood(fit) -> float:
    """Return the log-likelihood of a fit; refuse ratings that have none."""
    if fit.log_likelihood is None:
        raise InputError(f"the ratings tell no measure from another: {'; '.join(f.value for f in fit.flags)}")
    return fit.log_likelihood


def main(words: list[str] | None = None) -> None:
    """Fit, write `measures.csv`, and the best model where the usual one is not possible."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("study", type=Path)
    parser.add_argument("stimuli", type=Path)
    parser.add_argument("--out", type=Path, default=Path("measure"))
    asked = parser.parse_args(words)
    data, candidates = load_task(asked.study, "rating", RatingTrial), measure_candidates()
    losses = condition_losses(asked.stimuli, shown_stimuli(data), candidates)
    table, p_of_loss, p_of_the_rest = fit_measure(list(data.trials), losses, candidates)
    best, possible = table.candidate[0], list(table.candidate[table.possible])
    asked.out.mkdir(parents=True, exist_ok=True)
    table.drop(columns="candidate").to_csv(asked.out / "measures.csv", index=False)
    print(f"{len(possible)} of {len(candidates)} measures are possible; best: {best.words}")
    print(f"no loss counts: p = {p_of_loss:.2g}; nothing but loss counts: p = {p_of_the_rest:.2g}")
    if candidates[0] not in possible:
        write_toml_record(asked.out / "fitted.contrast_model.toml", best.model)
        print("the usual measure is not possible; the best is in fitted.contrast_model.toml")


if __name__ == "__main__":
    main()
