"""Statistics of trials in a plain table: thresholds, a rate limit, findings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from numbers import Real
from os import PathLike
from typing import TYPE_CHECKING, Any

import pandas as pd

from evenlight.analysis.calibration.calibration import calibrate
from evenlight.analysis.calibration.ramp_fit import RampFit
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions, default_model
from evenlight.analysis.dataset_findings import DEFAULT_SLOWING, AnalysisOptions, task_findings
from evenlight.analysis.inference.binomial_tests import DEFAULT_MARGIN
from evenlight.analysis.ramp_loading import RampData
from evenlight.analysis.results import Analysis
from evenlight.analysis.session_loading import task_data_of
from evenlight.data_schema.arguments import choice, flag, must_be_one_of, number, text, whole
from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import ArgumentError, InputError
from evenlight.data_schema.importing.imported_order import ITEMS
from evenlight.data_schema.mapping import keys_of, nullable_fields, record_from_mapping, type_hints
from evenlight.data_schema.rate_limit import RateLimitForm, RateLimitModel, Sigmoid
from evenlight.data_schema.recordings.ramp import Procedure, RampTrial
from evenlight.data_schema.recordings.ramp_values import with_end
from evenlight.data_schema.recordings.rating_scale import ONE_TO_FIVE, scale_of
from evenlight.data_schema.recordings.session import TASKS
from evenlight.data_schema.recordings.viewing import repetitions
from evenlight.method.preset_files import load_display
from evenlight.progress import shown_progress
from evenlight.stimuli.video.frames_in_memory import Named

if TYPE_CHECKING:
    from collections.abc import Iterable

# Columns that statistics do not read, and that another laboratory's table need not have.
NOT_READ: dict[str, dict[str, Any]] = {
    "rating": {"repetition": 1},
    "comparison": {"repetition": 1},
    "search": {"time_limit_s": 30.0},
}
LUMINANCE_TOLERANCE = 0.01  # of a measured luminance
IDENTIFIERS = ("participant_id", "session_id", "sequence", "keypoint")  # text, also where it is a number
ANSWERS = {True: "yes", False: "no", "1": "yes", "0": "no"}  # True is 1


def fit_ramps(
    table: pd.DataFrame | Iterable[Mapping[str, Any]] | Mapping[str, Any],
    *,
    display: Named | Display = "varjo-xr3",
    simulated: bool = False,
    model: str | None = None,
    form: RateLimitForm | str | None = None,
    degree: int | None = None,
    monotone: bool = False,
    sigmoid: str = "logistic",
    procedure: str | None = None,
) -> RampFit:
    """Fit psychometric functions and the rate limit to a table of luminance ramps (Section 3.4).

    Parameters
    ----------
    table : DataFrame, or what pandas makes one of
        One row for each ramp and its answer. Columns: `participant_id` (letters and digits),
        `luminance_cd_m2` before the ramp, `rate_cd_m2_s` (0 in a catch trial), and `response` ("yes" or "no",
        true or false, 1 or 0; of two intervals "first" or "second", with `ramp_interval` 1 or 2). Optional:
        `direction` ("down" or "up"; down), `duration_s` (5), `screen` ("white" or "gray"; white), `factor`
        (luminance over the display's peak), and any other column of `trials.tsv`.
    display : str, path or Display
        What the ramps were shown on: the rate limit holds for it alone.
    simulated : bool
        Whether simulated participants answered, as a column `simulated` says too; thresholds, rate limit and
        tracks tell.
    model : {"joint", "individual", "pooled"}, optional
        How answers become the curve: all at once, with a simultaneous band; a threshold for each participant
        and level, then a curve; all answers pooled, as if of one person. The others are fitted too. Default:
        "joint", but "individual" for the form "rate".
    form : {"ln_rate", "rate", "log_log"}, optional
        What the polynomial describes: ln(rate) over luminance, the rate, ln(rate) over ln(luminance). Else by
        predictive score (joint), or "ln_rate".
    degree : int, optional
        Of the polynomial. Else by predictive score (joint), or 4 as in the paper.
    monotone : bool
        Whether the curve may not fall with luminance (joint).
    sigmoid : {"logistic", "normal", "weibull"}
        Which psychometric function the joint model has. `RampFit.thresholds` are of logistic ones.
    procedure : {"yes_no", "two_interval"}, optional
        The task whose answers are fitted, where the table holds both.

    Returns
    -------
    RampFit
        Thresholds, psychometric functions and the rate limit; it can be asked, drawn and saved.

    Raises
    ------
    InputError
        If a column is missing, a row cannot be (which names the row), or there are too few levels.
    """
    panel = load_display(display)
    described = None if form is None else choice("form", form, RateLimitForm)
    options = RateLimitOptions(
        form=described,
        degree=None if degree is None else whole("degree", degree),
        procedure=None if procedure is None else choice("procedure", procedure, Procedure),
        model=default_model(described) if model is None else choice("model", model, RateLimitModel),
        monotone=flag("monotone", monotone),
        sigmoid=choice("sigmoid", sigmoid, Sigmoid),
    )
    rows = _rows_of(table, ("participant_id", "luminance_cd_m2", "rate_cd_m2_s", "response"))
    simulated = flag("simulated", simulated) or _says_simulated(rows)
    trials = [
        _record(RampTrial, _ramp_row(row, panel, number), number, {}, simulated)
        for number, row in enumerate(rows)
    ]
    kept = tuple(trial for trial in trials if trial.usable)
    if not kept:
        raise InputError("the table holds no ramp that counts: expected a row for each ramp and its answer")
    data = RampData("ramp", (), simulated, sha256="", warnings=(), rows=kept, display=panel)
    with shown_progress(True, "fitting thresholds and curve") as progress:
        return RampFit(calibrate(data, options, progress.at))


def analyze(
    table: pd.DataFrame | Iterable[Mapping[str, Any]] | Mapping[str, Any],
    task: str | None = None,
    *,
    simulated: bool = False,
    seed: int = 1,
    margin: float = DEFAULT_MARGIN,
    slowing: float = DEFAULT_SLOWING,
    scale: str | None = None,
) -> Analysis:
    """Compute the statistics of ratings, comparisons or search times in a plain table.

    Parameters
    ----------
    table : DataFrame, or what pandas makes one of
        One row for each answer. All have `participant_id` (letters and digits) and `sequence`. Ratings:
        `version` ("ours" or "baseline") and `rating`; optional `place_in_pair` (1 if shown before the other
        version) or `trial_index`, from which it follows; else unknown. Comparisons: `ours_interval` (1 or 2)
        and `response` ("first" or "second"). Searches: `keypoint`, `version`, `found` (or `correct`),
        `search_time_s` (less than the limit where not found: a wrong answer); optional `factor` (brightness
        factor there), `time_limit_s` (else the longest time, or 30), `ring_orientation_deg`,
        `reported_orientation_deg`, `repetition` (else by `trial_index` or row, if most places were searched
        several times). Other columns of `trials.tsv` may be there.
    task : {"rating", "comparison", "search"} or a registered task, optional
        Else the columns tell.
    simulated : bool
        Whether simulated participants answered, as a column `simulated` says too.
    seed : int
        Seed of permutations and bootstrap samples.
    margin : float
        Comparison: shares within 0.5 ± margin count as no difference.
    slowing : float
        Search: times that are longer by less than this share count as no slowing.
    scale : str, optional
        Rating: the scale, as "1..7", "0..100" or "1..5:0.5". Else the smallest usual one that holds all
        ratings, which a warning names where it is not 1 to 5 in whole points.

    Returns
    -------
    Analysis

    Raises
    ------
    InputError
        If a column is missing, a row cannot be (which names the row), or the rows cannot be analysed.
    """
    viewing = {name: records.trial for name, records in TASKS.items() if name != "ramp"}
    if task is not None and not (isinstance(task, str) and task in viewing):
        raise must_be_one_of("task", task, viewing)
    rows = _rows_of(table, ("participant_id", "sequence"))
    simulated = flag("simulated", simulated) or _says_simulated(rows)
    task = task or _task_of({key for row in rows for key in row})
    if task == "rating":
        rows = _with_places(rows)
    if task == "search":
        rows = _with_repetitions(rows)
    cls, defaults = viewing[task], NOT_READ.get(task, {})
    trials = [_record(cls, row, number, defaults, simulated) for number, row in enumerate(rows)]
    options = AnalysisOptions(
        seed=whole("seed", seed), margin=number("margin", margin), slowing=number("slowing", slowing)
    )
    data = task_data_of(task, trials, simulated)
    if task == "rating":
        given = [(f"row {row} of the table", trial.rating) for row, trial in enumerate(trials)]
        own, said = scale_of(given, "" if scale is None else text("scale", scale), "scale")
        data = replace(data, scale=own, warnings=() if scale is not None or own == ONE_TO_FIVE else (said,))
    elif scale is not None:
        raise ArgumentError("scale", f"is of ratings, not of a {task}")
    with shown_progress(True, f"analysing {task}"):
        return task_findings(data, options)


def _rows_of(table: Any, needed: tuple[str, ...]) -> list[dict[str, Any]]:
    """Return the rows of a table as mappings of plain values, without empty cells."""
    if isinstance(table, str | PathLike):
        raise InputError(f"table must be a table, got the path {table}; read it with pandas.read_csv")
    try:
        frame = table if isinstance(table, pd.DataFrame) else pd.DataFrame(table)
    except (TypeError, ValueError) as error:
        raise InputError(f"table must be a DataFrame or what pandas makes one of: {error}") from None
    if "luminance_cd_m2" not in frame:  # as `trials.tsv` calls it
        frame = frame.rename(columns={"initial_luminance_cd_m2": "luminance_cd_m2"})
    missing = [name for name in needed if name not in frame]
    if missing:
        has = ", ".join(map(str, frame.columns)) or "none"
        hint = "; ramps are for `fit_ramps`" * ("rate_cd_m2_s" in set(frame) - set(needed))
        raise InputError(f"the table has no column {', '.join(missing)}; its columns are {has}{hint}")
    if frame.empty:
        raise InputError("the table has no row; expected one for each answer")
    rows = []
    for row in frame.to_dict("records"):
        plain = {str(key): getattr(value, "item", lambda v=value: v)() for key, value in row.items()}
        rows.append({key: value for key, value in plain.items() if not pd.isna(value)})
        empty = [name for name in needed if name not in rows[-1]]
        if empty:
            raise InputError(f"row {len(rows) - 1} of the table: no {', '.join(empty)}")
    return rows


def _says_simulated(rows: list[dict[str, Any]]) -> bool:
    """Return whether a table labels any of its answers as simulated."""
    return any(str(row.get("simulated", "")).lower() in ("true", "1", "1.0") for row in rows)


def _record(
    cls: type[Any], row: dict[str, Any], number: int, defaults: Mapping[str, Any], simulated: bool
) -> Any:
    """Return the trial of a row; what is not in it and not needed has a default."""
    known, required = keys_of(cls)
    nullable = nullable_fields(cls)
    unknown = {key: None for key, name in known.items() if name in nullable}
    filled = {"session_id": "01", "trial_index": number, **unknown, **defaults}
    values = {key: value for key, value in filled.items() if key in required}
    values |= {key: value for key, value in row.items() if key in known}
    truths = {key for key in values if type_hints(cls)[known[key]] is bool and values[key] in (0, 1)}
    values |= {key: values[key] == 1 for key in truths}
    values |= {"simulated": simulated}
    values |= {key: _identifier(values[key]) for key in IDENTIFIERS if key in values}
    missing = sorted(set(required) - set(values))
    if missing:
        raise InputError(f"row {number} of the table: no {', '.join(missing)}")
    return record_from_mapping(cls, values, f"row {number} of the table")


def _identifier(value: Any) -> str:
    """Return a participant's identifier as text: 1.0, as pandas reads a column with gaps, is 1."""
    return str(int(value)) if isinstance(value, float) and value.is_integer() else str(value)


def _ramp_row(row: dict[str, Any], display: Display, number: int) -> dict[str, Any]:
    """Return the columns of a ramp's record, with what follows from the others."""
    where = f"row {number} of the table"
    try:
        luminance, rate = float(row["luminance_cd_m2"]), float(row["rate_cd_m2_s"])
        duration = float(row.get("duration_s", 5.0))
    except (TypeError, ValueError) as error:
        raise InputError(f"{where}: {error}") from None
    highest = display.peak_luminance + display.reflected_luminance
    if luminance > highest * (1 + LUMINANCE_TOLERANCE):
        raise InputError(
            f"{where}: luminance_cd_m2 is {luminance:g}, above the {highest:g} of the display "
            f"{display.name!r}; give the display that the ramps were shown on"
        )
    answer, direction = row["response"], row.get("direction", "down")
    if answer in ("first", "second") and "ramp_interval" not in row:
        raise InputError(f"{where}: response is {answer!r} but there is no ramp_interval, 1 or 2")
    values = {"initial_luminance": luminance, "factor": None, "rate": rate, "duration": duration}
    ramp = with_end(values | {"direction": direction}, where, display)
    derived = {
        "screen": "white",
        "factor": ramp["factor"],
        "initial_luminance_cd_m2": luminance,
        "final_luminance_cd_m2": ramp["final_luminance"],
        "duration_s": duration,
        "is_catch": rate == 0,
        "procedure": "two_interval" if "ramp_interval" in row else "yes_no",
    }
    return derived | row | {"response": ANSWERS.get(answer, answer), "rate_cd_m2_s": ramp["rate"]}


def _task_of(columns: set[str]) -> str:
    """Return the task that the columns tell."""
    told = {"rating": "rating", "ours_interval": "comparison", "search_time_s": "search"}
    found = [task for column, task in told.items() if column in columns]
    if len(found) != 1:
        raise InputError(f"the columns do not tell the task: expected one of {', '.join(told)}, or give task")
    return found[0]


def _with_places(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return ratings with their place in the pair, as `trial_index` tells it; without that it is unknown."""
    if not all(isinstance(row.get("trial_index"), Real) for row in rows):
        return rows
    first: dict[tuple[Any, Any], Any] = {}
    for row in sorted(rows, key=lambda row: row["trial_index"]):
        first.setdefault((row.get("participant_id"), row.get("sequence")), row.get("version"))
    versions = (first[row.get("participant_id"), row.get("sequence")] for row in rows)
    return [
        {"place_in_pair": 1 if row.get("version") == version else 2} | row
        for row, version in zip(rows, versions, strict=True)
    ]


def _with_repetitions(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return searches with what follows: `found` from `correct`, the limit as a time, the repetition."""
    rows = [dict(row) for row in rows]
    for row in rows:
        if "correct" in row:
            row.setdefault("found", row["correct"])
    timed = [row for row in rows if isinstance(row.get("search_time_s"), Real)]
    longest = max((row["search_time_s"] for row in timed), default=0.0)
    # The longest search tells the limit, if some without success have times and none is found after these.
    told = any(row.get("found") == 0 and row["search_time_s"] == longest for row in timed)
    limit = longest if told else max(longest, NOT_READ["search"]["time_limit_s"])
    for row in rows:
        row.setdefault("time_limit_s", limit)
        if row.get("found") == 0:
            row.setdefault("search_time_s", row["time_limit_s"])
    for row, which in zip(rows, repetitions(rows, ITEMS["search"]), strict=True):
        row.setdefault("repetition", which)
    return rows
