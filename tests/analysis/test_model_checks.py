"""Draws of the joint model as ArviZ's InferenceData, and what they say of the model."""

import dataclasses
import importlib.util
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from example_ramps import RAMP, answer_of, ramp_of
from scipy import special, stats

from evenlight.analysis.calibration.calibration import Calibration, calibrate
from evenlight.analysis.calibration.inference_data import arviz, inference_data
from evenlight.analysis.calibration.joint.joint_fit import fit_joint
from evenlight.analysis.calibration.joint.marginal_likelihood import ln_odds, smoothed, within_beta_nodes
from evenlight.analysis.calibration.joint.population_curve import PriorScales
from evenlight.analysis.calibration.model_checks import checks_section, predicted_shares, tilts
from evenlight.analysis.fit_commands import fit
from evenlight.analysis.ramp_loading import RampData
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.rate_limit import RateLimitModel, Sigmoid
from evenlight.data_schema.recordings.ramp import Procedure, RampDesign, RampTrial
from evenlight.experiments.viewing.simulate_viewing import ViewingSimulation, simulate_viewing
from evenlight.method.preset_files import load_display
from evenlight.method.psychometric import PsychometricFunction, log_likelihood, yes_probability
from evenlight.tables import fit_ramps

LUMINANCES = (10.0, 25.0, 60.0, 100.0)
RATES = np.geomspace(0.006, 0.12, 8)
LAPSES, GUESSES, WIDTH = 0.02, 0.06, 1.6
FACTORS = (0.7, 0.9, 1.0, 1.1, 1.4)


def answers(tilt: float = 0.0, total: int = 20) -> tuple[RampTrial, ...]:
    """Five people's answers without chance: thresholds rise as L^(1 + tilt), L^(1 - tilt) in turns."""
    trials = []
    for k, factor in enumerate(FACTORS):
        numbers = iter(
            np.random.default_rng(k).permutation(len(LUMINANCES) * (len(RATES) + 1) * total).tolist()
        )
        for luminance in LUMINANCES:
            own = 0.025 * factor * luminance * (luminance / 35) ** (tilt * (-1) ** k)
            function = PsychometricFunction(own, WIDTH, GUESSES, LAPSES)
            for rate in (*(RATES * luminance), 0.0):
                yes = round(total * float(yes_probability(rate, function)))
                trials += [
                    ramp_of(luminance, float(rate), RAMP, participant_id=f"{k + 1:02d}", duration=4.0,
                            trial_index=next(numbers), response=answer_of(Procedure.YES_NO, one < yes))
                    for one in range(total)
                ]  # fmt: skip
    return tuple(trials)


@pytest.fixture(scope="module")
def calibration() -> Calibration:
    display = load_display("varjo-xr3")
    return calibrate(RampData("ramp", (), False, sha256="", warnings=(), rows=answers(), display=display))


@pytest.fixture(scope="module")
def data(calibration: Calibration) -> Any:
    return inference_data(calibration, size=1500, seed=3)


def assert_same_interval(draws: Any, low: float, high: float, slack: float = 0.0) -> None:
    """2.5 % of the draws lie beyond either end, within four Monte Carlo errors (the fit draws 4000)."""
    tolerance = 4 * (0.025 * 0.975 * (1 / len(draws) + 1 / 4000)) ** 0.5 + slack
    assert abs(np.mean(draws < low) - 0.025) < tolerance
    assert abs(np.mean(draws > high) - 0.025) < tolerance


def test_draws_have_the_intervals_of_the_fit(calibration: Calibration, data: Any) -> None:
    joint, posterior = calibration.models.joint, data.posterior
    assert joint is not None
    for k in (0, 48, 96):
        edges = joint.pointwise_lower[k], joint.pointwise_upper[k]
        assert_same_interval(posterior.rate_limit.values[0, :, k], *map(float, edges))
    for person in joint.participants:
        own = posterior.participant_factor.sel(participant=person.participant_id).values[0]
        assert_same_interval(own, person.ci_low, person.ci_high, 0.02)  # which is to first order
    spread = joint.participant_sd
    assert_same_interval(posterior.participant_sd.values[0], spread.ci_low, spread.ci_high)
    ratios = data.sample_stats.ln_density_ratio.values[0]
    assert arviz().psislw(ratios)[1] < 0.7  # the normal curve stands for the exact posterior


def test_draws_know_their_units_and_where_they_are_from(data: Any) -> None:
    assert data.posterior.rate_limit.dims == ("chain", "draw", "luminance")
    assert data.posterior.lapse_rate.dims == ("chain", "draw", "participant")
    assert data.posterior.rate_limit.attrs["units"] == "cd/m^2/s"
    assert (data.posterior.attrs["simulated"], data.posterior.attrs["seed"]) == ("false", 3)
    assert {"evenlight_version", "arviz_version", "numpy_version"} <= data.log_likelihood.attrs.keys()
    cells = data.constant_data.n_trials
    assert cells.dims == ("participant", "level")
    assert (cells == 20 * len(RATES)).all()
    assert (data.observed_data.n_success <= cells).all()


def test_lapse_and_guess_rates_drawn_lie_about_the_true_ones(data: Any) -> None:
    for name, truth in (("lapse_rate", LAPSES), ("guess_rate", GUESSES)):
        mean = data.posterior[name].mean(("chain", "draw")).values
        assert (np.abs(mean - truth) < 0.02).all()
    assert abs(float(data.posterior.width.mean()) - WIDTH) < 0.15


def test_people_are_drawn_as_the_evaluation_has_them_and_cells_with_their_scatter_summed_over(
    calibration: Calibration,
) -> None:
    joint = calibration.models.joint
    assert joint is not None
    population, rng = joint.population, np.random.default_rng(8)
    tables, node = population.tables, population.central
    f = population.prior.design @ node.at - np.log(tables.luminance)
    smooth = smoothed(tables, node.spread.level_sd)
    drawn = [smooth.drawn(f, node.spread, rng) for _ in range(300)]
    seen = smooth.evaluate(f, node.spread)
    assert drawn[0][3] == pytest.approx(seen.value, abs=1e-9)
    u, places = (np.array([own[k] for own in drawn]) for k in (0, 1))
    mean, sd = seen.of_u @ seen.u, np.sqrt(seen.of_u @ seen.u**2 - (seen.of_u @ seen.u) ** 2)
    assert (np.abs(u.mean(axis=0) - mean) < 4 * sd / 300**0.5).all()
    width = np.take_along_axis(tables.ln_width, places.T, axis=1).mean(axis=1)
    np.testing.assert_allclose(width, (seen.of_nodes * tables.ln_width).sum(axis=1), atol=0.08)
    z = np.linspace(-5, 5, 201)
    for (c, p), [(counts, x)] in tables.cells.items():
        k = p, places[0, p]
        width, guess, lapse = np.exp(tables.ln_width[k]), tables.guess_rate[k], tables.lapse_rate[k]
        ln_each = [
            log_likelihood(
                PsychometricFunction(float(threshold), float(width), float(guess), float(lapse)),
                np.exp(x), counts.n_yes, counts.n_trials,
            )
            for threshold in np.exp(f[c] + u[0, p] + z * node.spread.level_sd)
        ]  # fmt: skip
        wanted = special.logsumexp(ln_each - 0.5 * z**2) - special.logsumexp(-0.5 * z**2)
        assert drawn[0][2][c, p] == pytest.approx(wanted, abs=0.05)


def test_values_within_nodes_follow_their_density() -> None:
    """A node by its mass, then within it: draws of the Beta density itself, cut off."""
    rng = np.random.default_rng(5)
    nodes = stats.beta(1, 30).ppf(stats.beta(1, 30).cdf(0.2) * (special.roots_legendre(4)[0] + 1) / 2)
    values = nodes[rng.choice(4, 4000, p=special.roots_legendre(4)[1] / 2)]
    found = within_beta_nodes(values, (1, 30), 0.2, 4, rng)
    cut = stats.beta(1, 30).cdf(0.2)
    assert stats.kstest(found, lambda x: stats.beta(1, 30).cdf(x) / cut).pvalue > 0.001


def test_shares_outside_their_prediction_are_found() -> None:
    made = np.random.default_rng(1).binomial(50, 0.5, (1, 4000, 2, 3))
    seen = np.array([[25, 24, 26], [25, 45, 25]])  # 45 of 50 where 25 are expected: 5.7 standard deviations
    made[..., 0, 2] = seen[0, 2] = 0
    n = np.array([[50, 50, 0], [50, 50, 50]])
    az = arviz()
    dims = {"n_success": ["participant", "level"], "n_trials": ["participant", "level"]}
    data = az.from_dict(
        posterior={"x": made[..., 0, 0]}, posterior_predictive={"n_success": made},
        observed_data={"n_success": seen}, constant_data={"n_trials": n}, dims=dims,
        coords={"participant": ["01", "02"], "level": ["a", "b", "c"]},
    )  # fmt: skip
    data.posterior = data.posterior.assign_coords(participant=["01", "02"], level=["a", "b", "c"])
    found = predicted_shares(data)
    assert found.outside.tolist() == [[False] * 3, [False, True, False]]
    assert [name for name, p in found.p_values.items() if p < 0.001] == ["02", "b"]
    assert found.p_values["01"] > 0.5


def test_tilts_are_found_where_people_have_them() -> None:
    known, p = tilts(fit_joint(answers(tilt=0.2)).population)
    assert p < 0.001
    signs = [(-1) ** k for k in range(len(FACTORS))]
    middle = 0.2 * np.mean(signs)  # the curve has the mean tilt
    for (tilt, error), sign in zip(known.values(), signs, strict=True):
        assert abs(tilt - (0.2 * sign - middle)) < 2 * error + 0.06
    assert tilts(fit_joint(answers()).population)[1] > 0.5


def test_other_priors_weigh_the_nodes_as_a_fit_with_them_does(calibration: Calibration) -> None:
    joint = calibration.models.joint
    assert joint is not None
    scales = PriorScales(participant_sd=0.15, level_sd=0.1, deviation=0.2)
    weighed, fitted = joint.population.reweighed(scales), joint.refit(joint.options, scales)
    means = [
        sum(w * node.spread.participant_sd for w, node in zip(own.weights, own.nodes, strict=True))
        for own in (joint.population, weighed, fitted)
    ]
    assert means[1] == pytest.approx(means[2], rel=0.03)
    assert means[1] < 0.95 * means[0]


@pytest.mark.parametrize("sigmoid", Sigmoid)
def test_a_sigmoid_is_at_75_percent_at_its_threshold_and_rises_by_90_percent_over_its_width(
    sigmoid: Sigmoid,
) -> None:
    def shares(x: list[float]) -> Any:
        return special.expit(ln_odds(np.array(x), np.log(1.6), np.array(0.1), sigmoid))

    middle = float(shares([0.0])[0])
    assert 0.1 + 0.9 * middle == pytest.approx(0.75)
    x = np.linspace(-3, 3, 6001)
    rises = shares(x.tolist())
    ends = np.interp([0.05, 0.95], rises, x)
    assert ends[1] - ends[0] == pytest.approx(1.6, abs=1e-3)
    known = {
        Sigmoid.LOGISTIC: special.logit,
        Sigmoid.NORMAL: special.ndtri,
        Sigmoid.WEIBULL: lambda share: np.log(-np.log1p(-share)),
    }
    bends = np.diff(known[sigmoid](rises[2000:4000]), 2)  # a line on its own scale
    assert np.abs(bends).max() < 1e-9


def test_another_sigmoid_can_be_asked_for_of_the_joint_model_alone_and_is_compared() -> None:
    """The last participant did not see the brightest level."""
    table = [
        {"participant_id": t.participant_id, "luminance_cd_m2": t.initial_luminance,
         "rate_cd_m2_s": t.rate, "response": t.response.value}
        for t in answers(total=8) if (t.participant_id, t.initial_luminance) != ("05", 100.0)
    ]  # fmt: skip
    normal, logistic = (fit_ramps(table, sigmoid=name) for name in ("normal", "logistic"))
    assert normal.calibration.models.joint.options.sigmoid is Sigmoid.NORMAL  # type: ignore[union-attr]
    ratio = normal.rate_limit([10.0, 100.0]) / logistic.rate_limit([10.0, 100.0])
    assert (np.abs(np.log(ratio)) < 0.1).all()
    assert (ratio != 1).all()
    section = checks_section(normal.calibration, normal.inference_data(draws=100))
    people, priors, sigmoids = section.tables
    assert next(row for row in people.rows if row[0] == "05")[1] == "0 of 3"
    assert people.rows[5][0] == "white, b = 0.958 (100 cd/m²)"  # as other tables name it; of varjo-xr3
    assert {row[0]: row[-1] == "as fitted" for row in sigmoids.rows} == {
        "logistic": False, "normal": True, "weibull": False,
    }  # fmt: skip
    assert [row[1] for row in priors.rows[:4]] == ["0.25, × 0.5", "1, × 2", "0.125, × 0.5", "0.5, × 2"]
    cells = [str(cell) for table in section.tables for row in table.rows for cell in row[1:]]
    assert not [cell for cell in cells if "-" in cell or "−0.0 " in cell or "−0 " in cell]
    verdict = section.paragraphs[
        -1
    ]  # of the tables: what moves most, and which sigmoids the answers tell apart
    most = max(float(str(row[2])[:-2].replace("−", "-")) ** 2 for row in priors.rows) ** 0.5
    assert f"halved or doubled, the limit changes by at most {most:.1f} %" in verdict
    best, *others = (row[0] for row in sigmoids.rows)
    assert f"The {best} function predicts the answers best, {others[0]} " in verdict
    with pytest.raises(InputError, match="another sigmoid is for the model joint"):
        fit_ramps(table, sigmoid="normal", model="pooled")


def test_checks_are_refused_without_their_extra_or_a_joint_model(
    monkeypatch: pytest.MonkeyPatch, calibration: Calibration, tmp_path: Path
) -> None:
    models = dataclasses.replace(calibration.models, joint=None, missing={RateLimitModel.JOINT: "too few"})
    with pytest.raises(InputError, match="no joint model to check: too few"):
        inference_data(SimpleNamespace(models=models))  # type: ignore[arg-type]
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"pip install 'evenlight\[bayes\]'"):
        fit(tmp_path / "data", out=tmp_path / "out", checks=True)


def test_fit_writes_draws_and_a_section_of_checks(tmp_path: Path) -> None:
    design = RampDesign(screens=("white",), repetitions=2)
    simulation = ViewingSimulation(3, 3, "ramp", load_display("varjo-xr3"), design)
    simulate_viewing(simulation, tmp_path / "data")
    fit(tmp_path / "data", out=tmp_path / "out", checks=True, quiet=True)
    data = arviz().from_netcdf(str(tmp_path / "out" / "joint_draws.nc"))
    joint = json.loads((tmp_path / "out" / "fit_summary.json").read_text())["joint"]
    assert data.posterior.participant.values.tolist() == [
        own["participant_id"] for own in joint["participants"]
    ]
    assert data.posterior.attrs["simulated"] == "true"
    report = (tmp_path / "out" / "report.html").read_text()
    for words in ("How the joint model fits", "joint_draws.nc", "mean lapse rate", "weibull", "Pareto k"):
        assert words in report
