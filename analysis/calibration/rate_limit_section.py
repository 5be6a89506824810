"""The section of the report on the rate limit: by which model, of which shape, how well known."""

from __future__ import annotations

import numpy as np

from evenlight.analysis.calibration.calibration import Calibration
from evenlight.analysis.calibration.joint.joint_fit import JointFit
from evenlight.analysis.calibration.limit_models import FEW_LEVELS, LimitModels
from evenlight.analysis.calibration.psychometric.thresholds import UNUSABLE
from evenlight.analysis.calibration.rate_limit.rate_limit_figure import FEWEST_FOR_INTERVALS
from evenlight.analysis.figure_style import short
from evenlight.analysis.report import Cell, Picture, Section, Table
from evenlight.analysis.report_prose import prose
from evenlight.analysis.wording import sentence
from evenlight.data_schema.rate_limit import RateLimit, RateLimitForm, RateLimitModel
from evenlight.data_schema.recordings.ramp import Procedure
from evenlight.method.rate_limit import rate_limit_at

LIMIT_ROWS = 7  # luminances at which the rate limit is listed


def rate_limit_section(calibration: Calibration, rate_limit_png: bytes, published: bool = True) -> Section:
    """Return the fitted rate limit, what it rests on, and what was left out.

    Parameters
    ----------
    calibration : Calibration
        What was fitted.
    rate_limit_png : bytes
        Its `rate_limit_figure`.
    published : bool
        Whether the figure shows the published rate limit too.
    """
    fit, models = calibration.rate_limit, calibration.models
    said = {f"{sentence(effect.in_words)}." for effect in fit.effects}
    ln_sd = None if fit.limit.form is RateLimitForm.RATE else fit.participant_sd
    text = prose(
        "fit_rate_limit",
        fit=fit,
        model=models.chosen.value,
        joint=models.joint,
        shape=shape_words(fit.limit),
        total=len(calibration.thresholds),
        few=models.levels if models.levels in FEW_LEVELS else 0,
        ends=[short(end) for end in fit.limit.luminance_range],
        effects=[sentence(effect.in_words.replace(" x ", " × ")) for effect in fit.effects],
        people_differ=None if ln_sd is None else float(np.exp(ln_sd)),
        excluded=calibration.excluded_participants,
        exp=np.exp,
    )
    caption = prose(
        "fit_rate_limit_caption",
        limit=fit.limit,
        people=len({t.participant_id for t in fit.own}),
        fewest=FEWEST_FOR_INTERVALS,
        crosses=models.chosen is RateLimitModel.JOINT and any(t.flag in UNUSABLE for t in fit.used),
        others=[model.value for model in models.others],
        published=published,
        simulated=calibration.data.simulated,
        two=calibration.procedure is Procedure.TWO_INTERVAL,
    )
    tables = [_limit_table(models)]
    if models.chosen is RateLimitModel.JOINT and models.joint is not None:
        tables.append(_shape_table(models.joint))
    if fit.effects:
        tables.append(_effect_table(calibration))
    first = tuple(f"{sentence(words)}." for words in models.first_notes)
    missing = tuple(f"Not fitted, the {model.value} model: {why}." for model, why in models.missing.items())
    return Section(
        "Rate limit",
        text,
        tuple(tables),
        (Picture(rate_limit_png, caption[0]),),
        tuple(note.replace("cd/m^2", "cd/m²") for note in (*first, *fit.notes, *missing) if note not in said),
        calibration.data.simulated,
    )


def shape_words(limit: RateLimit) -> str:
    """Return what kind of curve a limit is, for a sentence.

    >>> shape_words(RateLimit("r", "d", "", RateLimitForm.LOG_LOG, (0.0, 1.0), (1.0, 9.0)))
    'a polynomial of degree 1 for the logarithm of the rate over the logarithm of the luminance'
    """
    degree, form = len(limit.coefficients) - 1, limit.form
    if degree == 0:
        return "a constant"
    what = "the rate itself" if form is RateLimitForm.RATE else "the logarithm of the rate"
    over = "the logarithm of the luminance" if form is RateLimitForm.LOG_LOG else "luminance"
    return f"a polynomial of degree {degree} for {what} over {over}"


def _limit_table(models: LimitModels) -> Table:
    """Return the limit at some luminances, its bands, and the other models' curves as ratios to it."""
    limit, joint = models.fit.limit, models.joint if models.chosen is RateLimitModel.JOINT else None
    bands = {limit.band_words: [limit.band_luminance, limit.band_lower, limit.band_upper]}
    if joint is not None and models.levels not in FEW_LEVELS:
        edges = joint.band_luminance, joint.pointwise_lower, joint.pointwise_upper
        bands[f"{100 * limit.band_level:g} % pointwise band"] = [tuple(values.tolist()) for values in edges]
    rows: list[tuple[Cell, ...]] = []
    for L in np.unique(np.linspace(*limit.luminance_range, LIMIT_ROWS)).tolist():
        rate = float(rate_limit_at(limit, L))
        ratios = (
            float(rate_limit_at(other.limit, L)) / rate if rate else None for other in models.others.values()
        )
        rows.append(
            (
                L, rate, *(_edges_at(L, *band) for band in bands.values()), 100 * rate / L,
                *(None if ratio is None else f"{ratio:.2f}" for ratio in ratios),
            )
        )  # fmt: skip
    return Table(
        prose("fit_rate_limit_table", others=bool(models.others))[0],
        (
            "luminance [cd/m²]", "limit [cd/m²/s]", *bands, "limit [%/s]",
            *(f"{model.value} / limit" for model in models.others),
        ),
        tuple(rows),
    )  # fmt: skip


def _edges_at(
    luminance: float, at: tuple[float, ...], lower: tuple[float, ...], upper: tuple[float, ...]
) -> str | None:
    """Return the edges of a band at a luminance, in words; None without a band."""
    return " to ".join(f"{np.interp(luminance, at, edge):.3g}" for edge in (lower, upper)) if at else None


def _shape_table(joint: JointFit) -> Table:
    """Return how well each shape predicts answers, and which was taken."""
    best = max((shape.score for shape in joint.shapes if shape.score is not None), default=0.0)
    rows: list[tuple[Cell, ...]] = [
        (
            f"degree {shape.degree} of {shape.form.value.replace('_', ' ')}",
            None if shape.score is None else f"{shape.score - best:.1f}",
            None if shape.standard_error is None else f"{shape.standard_error:.1f}",
            "taken" if shape.chosen else "–",
        )
        for shape in joint.shapes
    ]
    return Table(prose("fit_shapes")[0], ("shape", "score", "standard error", ""), tuple(rows))


def _effect_table(calibration: Calibration) -> Table:
    """Return the other conditions as ratios to the reference."""
    rows: list[tuple[Cell, ...]] = [
        (
            effect.condition.words,
            f"{effect.ratio:.2f}",
            f"{effect.ci_low:.2f} to {effect.ci_high:.2f}",
            "1.00",
            f"{effect.ratio_of_equal_amounts:.2f}",
        )
        for effect in calibration.rate_limit.effects
    ]
    return Table(
        "Thresholds of other ramps as a multiple of those that the limit is for.",
        ("ramps", "ratio", "95 % confidence interval", "if the rate decides", "if the amount does"),
        tuple(rows),
    )
