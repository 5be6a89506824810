"""A pre-registration: a plan in plain text, before there are data, with which `fit` and `analyze` compare.

What the software knows is filled in; what it cannot know is left blank. The text ends in a block of JSON,
which alone is read again, so that the text may be filled in, translated and sent elsewhere.
"""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from evenlight.analysis.calibration.psychometric.serial_dependence import CLEAR_REPEATS
from evenlight.analysis.calibration.psychometric.thresholds import MAX_FALSE_ALARM_RATE
from evenlight.analysis.calibration.rate_limit.rate_limit_curve import RateLimitOptions, default_model
from evenlight.analysis.dataset_findings import AnalysisOptions
from evenlight.analysis.integrity.concern import ConcernKind
from evenlight.analysis.plans.plan import Plan, people_in_words
from evenlight.analysis.plans.questions import QUESTIONS, ComparisonTruth, RampQuestion, SearchTruth, Truth
from evenlight.analysis.report_prose import prose
from evenlight.analysis.session_loading import TaskData
from evenlight.analysis.wording import first_few, participants
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import mapping_from_record, plain_value, type_hints
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.quantities import file_key, typed
from evenlight.data_schema.recordings.dataset_layout import PREREGISTRATIONS
from evenlight.data_schema.recordings.ramp import Placement, RampDesign
from evenlight.data_schema.recordings.rating_scale import ONE_TO_FIVE
from evenlight.data_schema.recordings.roll_call import RollCall, SessionUse
from evenlight.data_schema.recordings.session import Design, SessionManifest
from evenlight.data_schema.recordings.study import Preregistration, digest_of, read_preregistration, study_of
from evenlight.data_schema.result_request import REQUEST, ResultRequest
from evenlight.data_schema.storage.text_files import read_toml_record
from evenlight.data_schema.storage.whole_files import write_whole
from evenlight.experiments.design_files import load_task_design
from evenlight.method.preset_files import load_display

READ = {"rating": ("seed",), "comparison": ("seed", "margin"), "search": ("slowing",)}  # options of analyze
How = RateLimitOptions | AnalysisOptions
Run = tuple[TaskData[Any], How]  # what is analysed, and how


def design_to_register(file: Path, task: str, asked: dict[str, Any]) -> tuple[str, Design]:
    """Return name and content of the one design that is registered, and let the plan ask for it alone.

    The design's own numbers of trials and sequences are put into what is asked.

    Raises
    ------
    InputError
        If the file is there or cannot be, several designs are given, or a number that the design has; or the
        earlier result, whose analysis is registered, has none.
    """
    if file.exists() or file.suffix != ".md" or not file.absolute().parent.is_dir():
        raise InputError(f"{file}: a pre-registration is a new file, .md, in a folder that is there")
    _fit_options(asked.get("analysis", ""))
    names = asked.pop("design", None) or ["recommended" if task == "ramp" else "paper"]
    design = load_task_design(task, names[0])
    if isinstance(design, RampDesign):
        constant = design.placement is Placement.CONSTANT
        each = design.repetitions * len(design.relative_rates) if constant else design.trials_per_level
        own: dict[str, Any] = {"design": (names[0],), "trials": str(each)}
    else:
        own = {"sequences": len(design.sequences), "repetitions": getattr(design, "repetitions", 1)}
    taken = own.keys() & {field.name for field in fields(QUESTIONS[task])}
    if len(names) > 1 or taken & asked.keys():
        numbers = " and ".join(f"`{name}`" for name in sorted(taken - {"design"}))
        raise InputError(f"a pre-registration is of one `design`, which says what {numbers} would")
    asked |= {name: own[name] for name in taken}
    return names[0], design


def register(
    file: Path, question: RampQuestion | Truth, plan: Plan, design: tuple[str, Design], made: str
) -> None:
    """Write a plan of one design, of a name, as the pre-registration that is made now, UTC (ISO 8601).

    As many take part as were planned for, if that was one number; else as many as every test needs.

    Raises
    ------
    InputError
        If no number of participants is enough, or the file cannot be written.
    """
    tests = [row for row in plan.rows if row.participants == plan.rows[-1].participants]
    single = len(tests) == len(plan.rows)
    needed = {row.participants if single else row.participants_needed for row in tests}
    if None in needed:
        raise InputError(f"{file}: no number of participants is enough; give one by `participants`")
    ramp = question if isinstance(question, RampQuestion) else None
    how: How = _fit_options(ramp.analysis) if ramp else AnalysisOptions()
    if isinstance(question, ComparisonTruth):
        how = AnalysisOptions(margin=question.margin)
    elif isinstance(question, SearchTruth):
        how = AnalysisOptions(slowing=round(question.margin - 1, 9))
    n, display = max(filter(None, needed)), load_display(ramp.display).name if ramp else ""
    name, shown = design
    inputs = {f"design {name}": digest_of(mapping_from_record(shown))}
    origin = provenance_now(plan.provenance.seed, inputs)
    options = options_of(question.task, how)
    registered = Preregistration(question.task, made, n, shown, display, options, origin)
    text = prose(
        "preregistration",
        r=registered,
        study=study_of(file.parent),
        dataset=file.absolute().parent.name,
        plan=plan,
        question=question,
        tests=tests,
        single=single,
        people=people_in_words,
        keys=[(file_key(f), _words(getattr(shown, f.name)), f.metadata["doc"]) for f in fields(shown)],
        usual=options_of("ramp", RateLimitOptions()),
        clear_repeats=CLEAR_REPEATS,
        most_false_alarms=MAX_FALSE_ALARM_RATE,
        concerns=[kind.value for kind in ConcernKind],
    )
    content = mapping_from_record(registered)
    block = json.dumps({**content, "sha256": digest_of(content)}, indent=1, ensure_ascii=False)
    write_whole(file, "\n\n".join([*text, f"```json\n{block}\n```\n"]))


def _fit_options(result: str) -> RateLimitOptions:
    """Return the options that an earlier result of `fit` was asked for; without one the usual."""
    asked = read_toml_record(ResultRequest, Path(result) / REQUEST).asked if result else {}
    kinds = type_hints(RateLimitOptions)
    known = kinds.keys() & asked.keys()
    told = {name: typed(kinds[name], asked[name], f"{result}: {name}") for name in known}
    return RateLimitOptions(**{"model": default_model(told.get("form")), **told})


def options_of(task: str, options: How) -> dict[str, Any]:
    """Return the options that the results of a task depend on, without those that are not set."""
    told = mapping_from_record(options)
    return {name: told[name] for name in READ.get(task, told) if told[name] is not None}


def registered_in(
    dataset: Path, tasks: Collection[str], given: Path | None = None
) -> dict[Path, Preregistration]:
    """Return the pre-registrations of a data set, or the given one.

    Raises
    ------
    InputError
        If one cannot be read or was changed, or the given one is of an experiment that is not analysed.
    """
    files = [given] if given else sorted(dataset.glob(PREREGISTRATIONS))
    found = {file: read_preregistration(file) for file in files}
    if given and (task := found[given].task) not in tasks:
        raise InputError(f"{given}: is of the experiment {task}, which is not analysed here")
    return found


def departures_of(plans: Mapping[Path, Preregistration], runs: Mapping[str, Run]) -> tuple[str, ...]:
    """Return how what is analysed, by task, departs from what was planned."""
    told = dict[str, list[str]]()
    for file, registered in plans.items():
        if (task := registered.task) in runs:
            found = list(_departures(registered, *runs[task]))
            many = f"{len(found) or 'no'} departure{'s' * (len(found) > 1)}"
            heading = f"{many} from the pre-registration {file} of {registered.made[:10]}"
            told.setdefault(task, []).extend((heading, *found))
    lines = {task: told.get(task, ["not pre-registered"]) for task in runs if told}
    return tuple(f"{task}: {words}" for task, own in lines.items() for words in own)


def _departures(registered: Preregistration, data: TaskData[Any], how: How) -> Iterator[str]:
    n, manifests = len(data.participant_ids), [session.manifest for session in data.sessions]
    if n != registered.participants:
        yield f"{participants(n)} instead of {registered.participants}"
    if data.roll:
        yield from _left_out(data.roll, registered.task)
    planned, shown = dict[str, int](), Counter[str]()
    for session in data.sessions:
        who = session.manifest.participant_id
        planned[who] = max(session.manifest.n_trials, planned.get(who, 0))
        shown[who] += len(session.trials)
    if off := [f"{who} ({n} of {planned[who]})" for who, n in shown.items() if n != planned[who]]:
        yield f"other numbers of trials that count than planned: participant {first_few(off)}"
    yield from _differences(registered, manifests)
    usual = _only_ones(registered.design) | options_of(registered.task, type(how)())
    now = usual | options_of(registered.task, how)
    planned_so = usual | registered.options  # an earlier version has no option that came later
    for name in sorted(now.keys() | planned_so.keys()):
        if (is_ := now.get(name)) != (was := planned_so.get(name)):
            yield f"analysed with {name} {_words(is_)} instead of {_words(was)}"
    if before := [m.participant_id for m in manifests if m.started and m.started < registered.made]:
        yield f"collected before it was written: participant {first_few(before)}"
    origins, ours = [provenance_now(), *(m.provenance for m in manifests)], registered.provenance
    versions = {origin.software_version for origin in origins} - {"unknown"}
    if others := sorted(v for v in versions if _main_part(v) != _main_part(ours.software_version)):
        yield f"with Evenlight {first_few(others)} instead of {ours.software_version}"


def _only_ones(design: Design) -> dict[str, Any]:
    """Return the options of `fit` that choose nothing, as the design has only one of the kind."""
    if not isinstance(design, RampDesign):
        return {}
    kinds = {
        "procedure": (design.procedure.value,),
        "direction": tuple(direction.value for direction in design.directions),
        "ramp_duration": design.ramp_durations,
    }
    return {name: own[0] for name, own in kinds.items() if len(own) == 1}


def _left_out(roll: RollCall, task: str) -> Iterator[str]:
    """Yield what is left out by no rule of the text."""
    for entry in roll.sessions:
        if entry.use is SessionUse.WRONG and entry.task in (None, task):
            yield f"{entry.folder} is left out, which was not planned: {entry.why}"
    missing = [who for who in roll.listed if who not in {entry.participant_id for entry in roll.sessions}]
    if missing:
        yield f"listed, but without a session, which was not planned: participant {first_few(missing)}"


def _differences(registered: Preregistration, manifests: list[SessionManifest]) -> Iterator[str]:
    """Yield what was shown otherwise than planned, and to whom."""
    planned = {**mapping_from_record(registered.design), "design": "known", "scale": str(ONE_TO_FIVE)}
    planned |= {"display": registered.display} if registered.display else {}
    who = defaultdict[str, list[str]](list)
    for m in manifests:
        shown = {"design": "known", **mapping_from_record(m.design)} if m.design else {"design": "unknown"}
        shown |= {"scale": str(m.scale), "display": m.display.name if m.display else "unknown"}
        for key in planned.keys() & shown.keys():
            if shown[key] != planned[key]:
                who[f"{key} {_words(shown[key])} instead of {_words(planned[key])}"].append(m.participant_id)
    for words, people in sorted(who.items()):
        yield words if len(people) == len(manifests) else f"{words}: participant {first_few(people)}"


def _words(value: Any) -> str:
    value = plain_value(value)
    if isinstance(value, list):
        return ", ".join(map(_words, value)) or "none"
    return "unset" if value is None else str(value).lower() if isinstance(value, bool) else str(value)


def _main_part(version: str) -> list[str]:
    parts = 2 if version.startswith("0.") else 1  # before 1.0 results may change with both
    return version.split(".")[:parts]
