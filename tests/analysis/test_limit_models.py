"""The rate limit by three models: which is chosen, what stands beside it, and limits without a curve."""

import dataclasses
import functools
import json
import math
from collections.abc import Callable, Sequence

import numpy as np
import pytest
from example_ramps import ramp_of

from evenlight.analysis.calibration.calibration import Calibration, calibrate
from evenlight.analysis.calibration.calibration_sections import curve_table
from evenlight.analysis.calibration.fit_report import summary_of
from evenlight.analysis.calibration.level_estimates import fit_pooled
from evenlight.analysis.calibration.limit_models import LimitModels
from evenlight.analysis.calibration.ramp_findings import ramp_findings
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions, basis_for
from evenlight.analysis.calibration.rate_limit.rate_limit_fit import fit_thresholds
from evenlight.analysis.ramp_loading import RampData
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import record_from_mapping
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.rate_limit import BandKind, RateLimit, RateLimitForm, RateLimitModel, Sigmoid
from evenlight.data_schema.recordings.ramp import Direction, RampTrial, Response
from evenlight.method.psychometric import PsychometricFunction, yes_probability
from evenlight.method.rate_limit import rate_limit_at, require_known, scalar_rate_limit

DISPLAY = Display("bench", 104.4, 0.2, 1.95, 72.28)
RELATIVE = np.array([0.008, 0.013, 0.02, 0.028, 0.04, 0.055, 0.08, 0.12])
PEOPLE = (0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.4)  # their thresholds as multiples of 3 %/s: the median is 1
LEVELS = (6.0, 12.0, 25.0, 50.0, 100.0)
NINETY = math.exp(2 * 1.96 * 0.35)  # how far the thresholds of 95 % of people lie apart


@functools.cache
def trials(
    people: Sequence[float] = PEOPLE,
    levels: Sequence[float] = LEVELS,
    directions: Sequence[Direction] = (Direction.DOWN,),
) -> tuple[RampTrial, ...]:
    """Ten ramps at each of eight rates and a catch trial for every four, of a Weber population."""
    rng = np.random.default_rng(8)
    rows: list[RampTrial] = []
    for number, factor in enumerate(people, start=1):
        for L in levels:
            for direction in directions:
                rates = np.concatenate([np.repeat(RELATIVE, 10), np.zeros(20)])
                function = PsychometricFunction(0.03 * L * factor, 1.4, 0.05, 0.02)
                seen = rng.random(rates.size) < yes_probability(rates * L, function)
                rows += [
                    ramp_of(L, rate * L, participant_id=f"{number:02d}", trial_index=len(rows) + k,
                            direction=direction, response=Response.YES if yes else Response.NO)
                    for k, (rate, yes) in enumerate(zip(rates.tolist(), seen.tolist(), strict=True))
                ]  # fmt: skip
    return tuple(rows)


@functools.cache
def fitted(rows: tuple[RampTrial, ...], options: RateLimitOptions | None = None) -> Calibration:
    """The calibration of trials in memory."""
    data = RampData("ramp", (), True, sha256="", warnings=(), rows=rows, display=DISPLAY)
    return calibrate(data, options)


@pytest.fixture(scope="module")
def joint() -> Calibration:
    return fitted(trials())


def test_the_joint_model_is_the_default_and_the_limit_says_so(joint: Calibration) -> None:
    limit = joint.rate_limit.limit
    assert (limit.model, limit.band_kind) == (RateLimitModel.JOINT, BandKind.SIMULTANEOUS)
    assert limit.band_words == "95 % simultaneous band"
    assert set(joint.models.others) == {RateLimitModel.INDIVIDUAL, RateLimitModel.POOLED}


def test_the_limit_knows_the_psychometric_function_that_it_is_a_point_of(joint: Calibration) -> None:
    """Width 1.4, guess rate 0.05, lapse rate 0.02 for everyone; pooled answers are nobody's."""
    for model in (RateLimitModel.JOINT, RateLimitModel.INDIVIDUAL):
        limit = joint.models.fits[model].limit
        assert limit.width == pytest.approx(1.4, rel=0.15), model
        assert limit.guess_rate == pytest.approx(0.05, abs=0.02), model
        assert limit.lapse_rate == pytest.approx(0.02, abs=0.02), model
        assert 0.15 < limit.participant_sd < 0.6, model  # seven people of SD 0.25
    low, high = joint.rate_limit.limit.width_range
    assert low < joint.rate_limit.limit.width < high
    pooled = joint.models.fits[RateLimitModel.POOLED].limit
    assert (pooled.width, pooled.guess_rate, pooled.lapse_rate) == (None, None, None)


def test_each_model_finds_the_median_persons_threshold(joint: Calibration) -> None:
    """3 %/s; seven people of SD 0.25 tell it to 0.25/sqrt(7) = 9 %, so three times that is the worst."""
    for fit in joint.models.fits.values():
        rates = rate_limit_at(fit.limit, [12.0, 50.0])
        np.testing.assert_allclose(np.log(rates / (0.03 * np.array([12.0, 50.0]))), 0, atol=0.27)


@pytest.mark.parametrize("model", [RateLimitModel.INDIVIDUAL, RateLimitModel.POOLED])
def test_the_earlier_fits_give_what_they_gave_and_the_joint_one_stands_beside_them(
    model: RateLimitModel,
) -> None:
    found = fitted(trials(), RateLimitOptions(model=model))
    quartic = RateLimitOptions(RateLimitForm.LN_RATE, degree=4)
    thresholds = [fit.threshold for fit in found.thresholds]
    earlier = (
        fit_thresholds(thresholds, DISPLAY, quartic)
        if model is RateLimitModel.INDIVIDUAL
        else fit_pooled(trials(), DISPLAY, quartic)
    )
    limit = found.rate_limit.limit
    assert limit.model is model
    for name in ("coefficients", "band_lower", "band_upper", "point_rate", "form", "luminance_range"):
        assert getattr(limit, name) == getattr(earlier.limit, name), name
    assert (limit.band_kind, limit.direction, limit.ramp_duration) == (BandKind.POINTWISE, Direction.DOWN, 5)
    assert RateLimitModel.JOINT in found.models.others


def test_the_summary_and_the_report_show_the_other_models_as_ratios(joint: Calibration) -> None:
    models = json.loads(json.dumps(summary_of(joint, Provenance())))["models"]
    ours, pooled = joint.rate_limit.limit, joint.models.fits[RateLimitModel.POOLED].limit
    there = np.linspace(6, 100, 201)
    mean = np.exp(np.mean(np.log(rate_limit_at(pooled, there) / rate_limit_at(ours, there))))
    assert models["pooled"]["ratio_to_chosen_mean"] == pytest.approx(mean, rel=1e-9)
    assert models["joint"]["ratio_to_chosen_max"] == 1
    limits, curves = ramp_findings(joint).sections[0].tables[:2]
    assert {"95 % simultaneous band", "95 % pointwise band"} <= set(limits.columns)
    there = np.linspace(6, 100, 401)
    share = rate_limit_at(pooled, there) / rate_limit_at(ours, there) - 1
    (said,) = [row[-1] for row in curves.rows if str(row[0]).startswith("pooled")]
    assert str(said).startswith(f"{100 * share[np.argmax(np.abs(share))]:+.0f} % at".replace("-", "−"))


def test_all_models_are_fitted_to_the_same_ramps() -> None:
    both = trials(people=PEOPLE[2:5], directions=(Direction.DOWN, Direction.UP))
    found = fitted(both, RateLimitOptions(direction=Direction.UP))
    assert {fit.limit.direction for fit in found.models.fits.values()} == {Direction.UP}
    assert len(found.models.fits) == 3


def test_a_limit_file_of_an_older_version_has_a_pointwise_band_of_no_known_model() -> None:
    old = {
        "name": "r", "display_name": "d", "display_fingerprint": "", "form": "rate", "coefficients": [2.0],
        "luminance_range_cd_m2": [10.0, 100.0],
    }  # fmt: skip
    limit = record_from_mapping(RateLimit, old, "old")
    assert (limit.model, limit.band_kind) == (None, BandKind.POINTWISE)
    assert (limit.width, limit.guess_rate, limit.lapse_rate) == (None, None, None)


@pytest.mark.parametrize(
    ("levels", "form", "degree", "said"),
    [
        ((20.0,), RateLimitForm.LOG_LOG, 0, "one level makes no curve: the limit is a constant"),
        ((20.0, 80.0), RateLimitForm.LOG_LOG, 1, "two levels make no curve"),
    ],
)
@pytest.mark.parametrize("model", list(RateLimitModel))
def test_one_or_two_levels_give_a_constant_or_a_line_and_say_so_first(
    levels: tuple[float, ...], form: RateLimitForm, degree: int, said: str, model: RateLimitModel
) -> None:
    found = fitted(trials(levels=levels), RateLimitOptions(model=model))
    limit = found.rate_limit.limit
    assert (limit.form, len(limit.coefficients) - 1) == (form, degree)
    assert limit.luminance_range == (levels[0], levels[-1])
    assert bool(limit.wide_band) is not bool(limit.band_luminance)  # as many coefficients as points: no band
    leading = [words for words in found.warnings[:2] if "no band" not in words]
    assert leading[0].startswith(said)
    # Beyond what was measured: the relative rate is held below, the rate above.
    low, high = (float(rate_limit_at(limit, L)) for L in limit.luminance_range)
    assert rate_limit_at(limit, levels[0] / 4) == pytest.approx(low / 4, rel=1e-12)
    assert rate_limit_at(limit, 10 * levels[-1]) == pytest.approx(high, rel=1e-12)
    one_by_one = scalar_rate_limit(limit)
    for L in (1.0, 20.0, 50.0, 300.0):
        assert one_by_one(L) == pytest.approx(float(rate_limit_at(limit, L)), rel=1e-12)
    assert curve_table(found.models).rows[0][-1] == "the limit"


def test_one_luminance_twice_is_the_range_of_a_constant_alone() -> None:
    with pytest.raises(ValueError, match="must rise"):
        RateLimit("r", "d", "", RateLimitForm.LOG_LOG, (0.0, 1.0), (20.0, 20.0))


def test_one_participant_alone_is_not_known_well_enough_and_two_no_worse() -> None:
    """How people differ is known from other studies alone: their 95 % reach over a ratio of about 4."""
    widths = []
    for people in ((1.0,), (0.9, 1.1)):
        found = fitted(trials(people=people))
        limit = found.rate_limit.limit
        assert limit.widest_band is not None
        _, lower, upper = limit.widest_band
        widths.append(upper / lower)
    one, two = widths
    assert one > two
    assert one > NINETY
    assert "the rate limit is not for use" in fitted(trials(people=(1.0,))).warnings[0]


@pytest.mark.parametrize("model", [RateLimitModel.INDIVIDUAL, RateLimitModel.POOLED])
def test_one_participant_of_another_model_has_no_band_which_is_said_first(model: RateLimitModel) -> None:
    found = fitted(trials(people=(1.0,)), RateLimitOptions(model=model))
    limit = found.rate_limit.limit
    assert limit.band_luminance == ()
    assert "no band" in found.warnings[0]
    with pytest.raises(
        InputError, match=f"fitted by the {model.value} model, it has no band; .*accept_wide_band"
    ):
        require_known(limit)
    require_known(limit, accept_wide_band=True)
    require_known(dataclasses.replace(limit, model=None))  # a preset, or a file of an older version


@pytest.mark.parametrize(("people", "refused"), [(PEOPLE[2:5], True), (PEOPLE[1:5], False)])
def test_fewer_than_four_participants_pooled_have_no_band(people: tuple[float, ...], refused: bool) -> None:
    """The scatter of pooled points knows nothing of people, of whom two or three tell little."""
    line = RateLimitOptions(RateLimitForm.LOG_LOG, degree=1, model=RateLimitModel.POOLED)
    limit = fitted(trials(people=people), line).rate_limit.limit
    assert ("no band" in limit.wide_band) is refused


def test_fewer_than_four_participants_are_told_where_the_width_comes_from(joint: Calibration) -> None:
    said = "comes from other studies"
    assert any(said in words for words in fitted(trials(people=PEOPLE[2:5])).warnings[:2])
    assert not any(said in words for words in joint.warnings)


def test_pooled_answers_leave_nobody_out() -> None:
    rows = tuple(
        dataclasses.replace(row, response=Response.YES) if row.participant_id == "03" else row
        for row in trials()
    )
    pooled = fitted(rows, RateLimitOptions(model=RateLimitModel.POOLED))
    assert pooled.excluded_participants == {}
    # The joint model stands beside it, and is refitted with another sigmoid where it is checked.
    assert pooled.models.joint is not None
    other = dataclasses.replace(pooled.models.joint.options, sigmoid=Sigmoid.NORMAL)
    assert other.model is RateLimitModel.JOINT


def test_a_band_too_wide_for_use_is_the_first_warning(joint: Calibration) -> None:
    fit = joint.rate_limit
    edges = {"band_lower": tuple(x / 3 for x in fit.limit.band_lower)}
    wide = dataclasses.replace(fit, limit=dataclasses.replace(fit.limit, **edges))
    models = LimitModels(RateLimitModel.INDIVIDUAL, {RateLimitModel.INDIVIDUAL: wide})
    found = dataclasses.replace(joint, models=models)
    assert found.warnings[0].startswith("the rate limit is not for use: at ")


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (lambda: RateLimitOptions(model=RateLimitModel.POOLED, monotone=True), "for the model joint"),
        (lambda: fitted(trials((1.0,)), RateLimitOptions(RateLimitForm.RATE)), "got the form rate"),
    ],
    ids=["monotone", "rate"],
)
def test_what_a_model_cannot_do_is_refused(asked: Callable[[], object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        asked()


def test_who_says_yes_to_nothing_is_left_out_by_name(joint: Calibration) -> None:
    """Yes to every catch trial: their criterion, not their eyes, set the threshold."""
    rows = tuple(
        dataclasses.replace(row, response=Response.YES) if row.participant_id == "03" else row
        for row in trials(PEOPLE[:4])
    )
    found = fitted(rows)
    assert found.excluded_participants == {"03": "false_alarms"}
    assert {t.participant_id for t in found.rate_limit.excluded} == {"03"}
    assert joint.excluded_participants == {}


def test_a_level_measured_on_two_calibrations_of_a_display_is_one_level_for_the_shape() -> None:
    """20 and 20.4 cd/m²: a line through both would be any line at all."""
    rows = trials(levels=(20.0, 80.0))
    again = {20.0: 20.4, 80.0: 78.5}
    moved = tuple(
        dataclasses.replace(
            row,
            initial_luminance=again[row.initial_luminance],
            final_luminance=row.final_luminance * again[row.initial_luminance] / row.initial_luminance,
            rate=row.rate * again[row.initial_luminance] / row.initial_luminance,
        )
        if row.participant_id > "03"
        else row
        for row in rows
    )
    found = fitted(moved)
    for model, fit in found.models.fits.items():
        limit = fit.limit
        assert (limit.form, len(limit.coefficients)) == (RateLimitForm.LOG_LOG, 2), model
        np.testing.assert_allclose(np.log(rate_limit_at(limit, [20.0, 80.0]) / [0.6, 2.4]), 0, atol=0.3)
    assert any("two levels make no curve" in words for words in found.warnings[:2])


def test_close_levels_are_as_many_as_they_are_for_the_shape() -> None:
    """Fourteen levels, neighbours 4 % apart: the paper's quartic, no constant; one level has no line."""
    close = np.geomspace(62.6, 104.0, 14)
    basis = basis_for(close, RateLimitOptions())
    assert (basis.form, basis.degree) == (RateLimitForm.LN_RATE, 4)
    with pytest.raises(InputError, match="at 2 or more luminances, got 1"):
        basis_for([100.0, 102.0], RateLimitOptions(degree=1), levels=1)


def test_a_limit_says_that_its_curve_was_kept_from_falling(joint: Calibration) -> None:
    found = fitted(trials(), RateLimitOptions(monotone=True))
    limit = found.rate_limit.limit
    assert (limit.monotone, joint.rate_limit.limit.monotone) == (True, False)
    assert any("kept from falling" in note for note in found.rate_limit.notes)
