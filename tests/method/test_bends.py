"""Losses at any factor: the bends of curves, their files, and what is published of gratings."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.optimizer_problems import mean_factor_problem
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.tracks.loss_bends import LossBends
from evenlight.data_schema.tracks.loss_curves import read_loss_curves, write_loss_curves
from evenlight.method.contrast.bends import bends_of
from evenlight.method.contrast.contrast_loss import loss_of, visible_contrast
from evenlight.method.contrast.curve_lookup import loss_and_slope, loss_at
from evenlight.method.contrast.loss_curves import analyze_frames
from evenlight.method.contrast.luminance import dimmed_luminance, emitted_luminance
from evenlight.method.optimizer.evaluate import no_worse_than_constant
from evenlight.method.optimizer.optimize import joined_curves
from evenlight.method.optimizer.splitting import SplittingSolver

LAB = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=30.0)
FACTORS = np.random.default_rng(0).uniform(0.25, 1, 20)


def grating(cpd, contrast, angle):
    """A grating in gray, at half of the display's luminance."""
    y, x = np.mgrid[:160, :240] / LAB.pixels_per_degree
    light = 0.5 * (1 + contrast * np.sin(2 * np.pi * cpd * (x * np.cos(angle) + y * np.sin(angle))))
    return np.repeat(light[..., None] ** (1 / LAB.gamma), 3, axis=2)


GRATINGS = [grating(2, 0.02, 0.4), grating(4, 0.02, 0.4), grating(4, 0.03, 0), grating(8, 0.03, 0.4)]


def curves_of(pictures):
    return analyze_frames([Frame(float(k), 1.0, p) for k, p in enumerate(pictures)], "gratings", LAB)


@given(st.lists(st.floats(0, 1), min_size=1, max_size=60), st.sampled_from([1e-3, 0.1]))
def test_lines_between_bends_come_within_the_tolerance(losses, tolerance):
    loss = np.array([*sorted(losses, reverse=True), 0.0])
    factors = np.geomspace(0.2, 1, len(loss))
    at, height = bends_of(factors, loss, tolerance).T
    assert np.abs(np.interp(factors, at, height) - loss).max() <= tolerance * (1 + 1e-9)


@pytest.mark.parametrize("picture", GRATINGS)
def test_losses_of_gratings_are_those_of_the_definition_at_any_factor(picture):
    """To 1e-3, at a factor within 0.1 %: where many pixels vanish at once, a curve is as good as a step."""
    light = emitted_luminance(picture, LAB)
    full = visible_contrast(light, LAB)
    dimmer, brighter = (
        np.array([loss_of(visible_contrast(dimmed_luminance(light, b, LAB), LAB), full) for b in factors])
        for factors in (FACTORS / 1.001, FACTORS * 1.001)
    )
    published = loss_at(curves_of([picture] * len(FACTORS)), FACTORS)
    assert (published <= dimmer + 1e-3).all()
    assert (published >= brighter - 1e-3).all()


def test_between_knots_losses_of_gratings_are_far_from_linear():
    """Else the knots alone would do."""
    curves = curves_of([grating(8, 0.03, 0)] * len(FACTORS))
    assert np.abs(loss_at(curves, FACTORS) - loss_and_slope(curves, FACTORS)[0]).max() > 0.05


def test_frames_that_are_alike_share_their_bends_and_joined_clips_keep_theirs():
    once, again = curves_of(GRATINGS[:2]), curves_of([GRATINGS[2], GRATINGS[2], GRATINGS[0]])
    assert again.bends.contents.tolist() == [0, 0, 1]
    joined = joined_curves([once, again])
    alone = [loss_at(curves, FACTORS[:n]) for curves, n in ((once, 2), (again, 3))]
    factors = np.concatenate([FACTORS[:2], FACTORS[:3]])
    np.testing.assert_array_equal(loss_at(joined, factors), np.concatenate(alone))
    assert joined_curves([once, replace(again, bends=None)]).bends is None


def test_below_the_lowest_factor_the_loss_is_that_at_it():
    curves = curves_of(GRATINGS[:1])
    assert loss_at(curves, np.array([0.1])) == pytest.approx(curves.loss[0, 0])


def test_bends_are_in_the_file_and_need_not_be(tmp_path):
    curves = curves_of(GRATINGS)
    for written in (curves, replace(curves, bends=None)):
        write_loss_curves(tmp_path / "c.npz", written)
        read = read_loss_curves(tmp_path / "c.npz")
        np.testing.assert_array_equal(loss_at(read, FACTORS[:4]), loss_at(written, FACTORS[:4]))


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("contents", np.array([2]), "one of the curves"),
        ("contents", np.array([0.0]), "whole numbers"),
        ("starts", np.array([0]), "one curve at least"),
        ("starts", np.array([0, 2, 5]), "begin and end with all points"),
        ("factors", np.array([0.2, 1.0, 0.5, 0.9]), "rising to 1"),
        ("factors", np.array([0.2, 1.0, 1.0, 1.0]), "rise from above 0"),
        ("factors", np.array([0.2, 1.0, np.nan, 1.0]), "rise from above 0"),
        ("factors", np.array([0.0, 1.0, 0.5, 1.0]), "rise from above 0"),
        ("loss", np.array([0.4, 0.0, np.nan, 0.0]), r"lie in \[0, 1\]"),
        ("loss", None, "bend_loss"),
    ],
)
def test_damaged_bends_are_told(name, values, message, tmp_path):
    whole = {"contents": [0], "starts": [0, 2, 4], "factors": [0.2, 1.0] * 2, "loss": [0.4, 0.0] * 2}
    bends = LossBends(**{key: np.array(numbers) for key, numbers in whole.items()})
    write_loss_curves(tmp_path / "c.npz", replace(curves_of(GRATINGS[:1]), bends=bends))
    with np.load(tmp_path / "c.npz") as content:
        arrays = dict(content) | {f"bend_{name}": values}
    np.savez(tmp_path / "c.npz", **{key: array for key, array in arrays.items() if array is not None})
    with pytest.raises(InputError, match=message):
        read_loss_curves(tmp_path / "c.npz")


def test_a_track_that_is_worse_than_constant_dimming_by_the_bends_is_not_given():
    """Two frames alike by their bends lose the same at any common factor, whatever their knots say."""
    curves = curves_of([GRATINGS[0], GRATINGS[0] * 0.8])
    alike = LossBends(np.array([0, 0]), np.array([0, 2]), np.array([0.2, 1.0]), np.array([0.5, 0.0]))
    for bends, kept in ((None, True), (alike, False)):
        problem = mean_factor_problem(replace(curves, bends=bends), 0.5)
        factors = SplittingSolver().solve(problem).factors
        assert problem.objective(factors) < problem.objective(problem.baseline())
        chosen = no_worse_than_constant(problem, factors)
        assert np.array_equal(chosen, factors if kept else problem.baseline())
