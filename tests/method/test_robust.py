"""The worst of several measures is minimized: contradictions, bounds, what is told of it."""

from typing import get_type_hints

import numpy as np
import pytest
from matplotlib.text import Text

import evenlight
from evenlight.analysis.tracks.dimming_options import DimmedOn
from evenlight.analysis.tracks.track_words import outcome_in_words
from evenlight.data_schema.errors import InputError
from evenlight.method.contrast.measures import measures_named
from evenlight.method.optimizer.calm import calmed
from evenlight.method.optimizer.optimize import feasible_blend, is_feasible
from evenlight.method.optimizer.robust import Measures, optimize_robustly
from evenlight.method.optimizer.splitting import FAR_TO_NEAR, SplittingSolver
from evenlight.method.preset_files import PRESETS

FAST = SplittingSolver(stages=FAR_TO_NEAR)

N = 24


@pytest.fixture(scope="module")
def measures(make_curves, make_problem):
    """A function that makes the problem of one clip for some strengths of loss, a row for each measure."""

    def made(strengths):
        curves = [make_curves(row, frames_per_second=0.5) for row in np.atleast_2d(strengths)]
        return Measures(tuple(make_problem(own, 0.5) for own in curves))

    return made


@pytest.mark.parametrize("scale", [1.0, 0.1])
def test_measures_that_contradict_each_other_leave_constant_dimming(measures, scale) -> None:
    # What the one measure loses in a frame, the other loses in its mirror image: every track and its mirror
    # image have mirrored shares, and a blend of the two, constant dimming for mirrored frames, is no worse.
    # A measure in other units has the same shares.
    strengths = np.where(np.arange(N) % 2, 0.2, 0.5)
    both = measures([strengths, scale * strengths[::-1]])
    found, bound, _ = optimize_robustly(both, FAST)
    assert both.worst(found.factors) == pytest.approx(1.0, abs=0.01)
    assert bound > 0.95
    alone = [FAST.solve(problem).factors for problem in both.problems]
    assert both.shares(alone[0])[0] < 0.95
    assert both.worst(alone[0]) > 1.05


def test_one_measure_twice_is_that_measure(measures) -> None:
    strengths = np.linspace(0.2, 0.6, N)
    twice = measures([strengths, strengths])
    found, *_ = optimize_robustly(twice, FAST)
    alone = twice.problems[0].objective(FAST.solve(twice.problems[0]).factors)
    assert twice.worst(found.factors) <= alone / twice.baselines()[0] + 1e-9


def test_the_worst_is_no_worse_than_by_any_measure_alone_and_none_goes_below_the_bound(measures) -> None:
    rng = np.random.default_rng(7)
    three = measures(rng.uniform(0.1, 0.6, (3, N)) * np.linspace(0.5, 1.5, N))
    found, bound, _ = optimize_robustly(three, FAST)
    worst, first = three.worst(found.factors), three.problems[0]
    assert is_feasible(first, found.factors)
    assert worst <= min(three.worst(FAST.solve(problem).factors) for problem in three.problems) + 1e-12
    assert 0.9 * worst < bound < worst + 1e-9  # as computed: not held to the worst
    for _ in range(200):  # feasible tracks about the answer, and about constant dimming
        about = found.factors if rng.random() < 0.5 else first.baseline()
        push = np.cumsum(rng.normal(0, 10 ** rng.uniform(-4, -1.5), N))
        other = np.clip(about + push - push.mean(), 0.2, 1.0)
        other = feasible_blend(first, np.clip(other - first.budget_error(other), 0.2, 1.0))
        if is_feasible(first, other):
            assert three.worst(other) >= bound


def test_a_calm_robust_track_gives_up_its_share_of_the_worst(measures) -> None:
    rng = np.random.default_rng(7)
    three = measures(rng.uniform(0.1, 0.6, (3, N)))
    found, bound, bounds = optimize_robustly(three, FAST)
    calm = calmed(three.problems[0], found.factors, 0.1, three.worst)
    assert three.worst(calm) <= 0.9 * three.worst(found.factors) + 0.1 + 1e-12
    worst, each = three.outcome(("a", "b", "c"), calm, bound, bounds)
    assert worst.name == "worst of a, b, c"
    assert worst.value == pytest.approx(max(m.value / m.baseline for m in each))
    assert worst.baseline == 1
    assert worst.bound <= three.worst(found.factors)
    for wrong in (
        (worst.value + 1e-6, bounds),
        (bound, (*bounds[:2], each[2].value + 1e-6)),
    ):
        with pytest.raises(RuntimeError, match=r"the lower bound .* is above"):
            three.outcome(("a", "b", "c"), calm, *wrong)


def test_frames_alike_by_all_measures_keep_constant_dimming(measures) -> None:
    alike = measures(np.full((2, N), 0.3))
    np.testing.assert_allclose(optimize_robustly(alike, FAST)[0].factors, 0.5)


def test_a_robust_track_tells_what_it_does_by_each_measure() -> None:
    rng = np.random.default_rng(3)
    frames = [
        np.clip(0.5 + s * rng.standard_normal((24, 32, 1)), 0, 1).repeat(3, 2) for s in (0.05, 0.2, 0.4)
    ]
    made = evenlight.optimize(frames, 0.5, fps=0.2, robust=True, measures="relative,absolute")
    worst, each = made.outcome.minimized, made.outcome.by_measure
    assert [own.name for own in each] == ["relative", "absolute"]
    assert made.outcome.contrast_model == "relative"
    assert each[0].value == pytest.approx(made.objective, abs=1e-12)
    assert worst.bound <= worst.value <= worst.baseline == 1
    assert made.gap == 1 - worst.bound / worst.value
    says = f"the worst of relative, absolute was minimized: {100 * worst.value:.1f} % of constant dimming's"
    assert says[1:] in outcome_in_words(made.outcome)
    drawn = " ".join(text.get_text() for text in made.plot("track").findobj(Text))
    assert says[1:] in drawn
    assert "measure_absolute" in made.outcome.provenance.inputs


def test_what_makes_no_robust_track_is_refused_in_one_line(measures, make_curves, command, tmp_path) -> None:
    with pytest.raises(InputError, match="two measures or more"):
        measures_named(["castle"])
    with pytest.raises(InputError, match="each once"):
        measures_named(["castle", "castle"])
    with pytest.raises(InputError, match="no measure 'castel'; give one of"):
        measures_named(["relative", "castel"])
    with pytest.raises(InputError, match="two measures or more, got 1"):
        measures(np.full((1, N), 0.1))
    with pytest.raises(InputError, match="leave out robust"):
        evenlight.optimize(make_curves(np.ones(4) / 2), 0.5, robust=True, measures="relative,castle")
    for more, words in (
        (
            ("--robust", "--contrast-model", "as-printed", "--with", "b.mp4"),
            "leave out --with, --contrast-model",
        ),
        (("--robust", "--objective", "minimax"), "leave out --objective"),
        (("--measures", "relative,castle"), "is for --robust"),
        (("--robust", "--measures", "soft,,"), "two measures or more, each once, got soft\n"),
    ):
        result = command("optimize", "sunrise", "--budget", 0.5, "--out", tmp_path / "o", *more)
        assert result.code == 2
        assert words in result.err
        assert result.err.count("\n") == 1


def test_the_help_lists_every_preset_of_the_contrast_model() -> None:
    presets = [path.name.partition(".")[0] for path in PRESETS.glob("*.contrast_model.toml")]
    assert presets
    asked = get_type_hints(DimmedOn, include_extras=True)["contrast_model"]
    assert all(f" {name}" in asked.__metadata__[0].help for name in presets)
