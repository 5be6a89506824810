"""A viewing task in one file: both versions of a sequence one after the other, and "which looks better?".

    export EVENLIGHT_TASKS=examples/which_looks_better.py
    evenlight simulate which_looks_better --participants 20 --stimuli stimuli --out pilot
    evenlight validate pilot
    evenlight analyze pilot --out results

`evenlight run which_looks_better …` conducts a session, as it does those of the tasks that come along.
"""

from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np

import evenlight
from evenlight.tasks import (
    Analysis,
    AnalysisOptions,
    ClipTask,
    ComparisonDesign,
    ComparisonTrial,
    Keys,
    Origin,
    PlannedTrial,
    Response,
    Section,
    SessionSetting,
    Statistic,
    Table,
    TaskData,
    Trial,
    TrialFlag,
    Version,
    Viewing,
    as_in,
    clopper_pearson,
    comparison_order,
    comparison_practice,
    described,
    exact_p,
    quantity,
    record,
)


# What is shown, how often, how. Fields that another task has as well are taken from there.
@record
class LooksDesign:
    """Which sequences are judged, and how often."""

    sequences: tuple[str, ...] = as_in(ComparisonDesign, "sequences")
    repetitions: int = quantity("1", "judgements of each sequence", minimum=1, default=2)
    adaptation_duration: float = as_in(ComparisonDesign, "adaptation_duration")
    practice_trials: int = as_in(ComparisonDesign, "practice_trials")
    practice_duration: float = as_in(ComparisonDesign, "practice_duration")
    trials_between_breaks: int = as_in(ComparisonDesign, "trials_between_breaks")
    max_dropped_share: float = as_in(ComparisonDesign, "max_dropped_share")
    repeat_flagged: bool = as_in(ComparisonDesign, "repeat_flagged")


# A line of trials.jsonl; `response` is this task's own, and the others are as in the comparison.
@record
class LooksTrial(Trial):
    """One judgement of the two versions of a sequence."""

    participant_id: str = as_in(ComparisonTrial, "participant_id")
    session_id: str = as_in(ComparisonTrial, "session_id")
    trial_index: int = as_in(ComparisonTrial, "trial_index")
    sequence: str = as_in(ComparisonTrial, "sequence")
    repetition: int = as_in(ComparisonTrial, "repetition")
    ours_interval: int = as_in(ComparisonTrial, "ours_interval")
    mean_factor: float = as_in(ComparisonTrial, "mean_factor")
    response: Response = described("which of the two looks better: first, second")
    response_time: float | None = as_in(ComparisonTrial, "response_time")
    simulated: bool = as_in(ComparisonTrial, "simulated")
    practice: bool = as_in(ComparisonTrial, "practice")
    block: int = as_in(ComparisonTrial, "block")
    attempt: int = as_in(ComparisonTrial, "attempt")
    onset: float | None = as_in(ComparisonTrial, "onset")
    noise_seed: int | None = as_in(ComparisonTrial, "noise_seed")
    n_frames: int | None = as_in(ComparisonTrial, "n_frames")
    frames_dropped: int | None = as_in(ComparisonTrial, "frames_dropped")
    flag: TrialFlag = described("why it is left out; empty for none", default=TrialFlag.NONE)

    def __post_init__(self) -> None:
        if self.response not in (Response.FIRST, Response.SECOND):
            raise ValueError(f"response must be 'first' or 'second', got {self.response.value!r}")

    @property
    def intervals(self) -> int:
        """How many videos a trial shows."""
        return 2

    @property
    def prefers_ours(self) -> bool:
        """Whether the modulated version looks better."""
        return (self.response is Response.FIRST) == (self.ours_interval == 1)


# The order is that of the comparison, counterbalanced. `ClipTask` shows the videos and asks.
class LooksTask(ClipTask):
    """A session of judgements."""

    def __init__(self, setting: SessionSetting) -> None:
        design: Any = setting.manifest.design
        order = comparison_order(design, setting.session[1])
        super().__init__(setting, order, comparison_practice(design, *setting.session))

    def answers(self, keys: Keys) -> dict[str, Response]:
        """Return the answer that each key gives."""
        return {keys.first: Response.FIRST, keys.second: Response.SECOND}

    def row(self, planned: PlannedTrial, answer: Response, columns: dict[str, Any]) -> LooksTrial:
        """Return the record of a judgement."""
        mean_factor = self.stimuli[planned.sequence].mean_factor(Version.OURS)
        return LooksTrial(**planned.columns, **columns, mean_factor=mean_factor, response=answer)


# Who answers in rehearsals and simulations.
@dataclass(frozen=True, slots=True)
class Judge:
    """A simulated participant: how often they prefer the modulated version."""

    preference: float


class Judges(Viewing):
    """Simulated participants, most of whom prefer the modulated version most of the time."""

    def __init__(self, setting: SessionSetting) -> None:
        """See nothing: these judges look at no video."""

    def draw(self, rng: np.random.Generator) -> Judge:
        """Return a participant."""
        return Judge(float(rng.beta(8, 3)))

    def answer(self, person: Judge, planned: PlannedTrial, rng: np.random.Generator) -> Response:
        """Return which of the two looks better."""
        prefers_ours = rng.random() < person.preference
        return Response.FIRST if prefers_ours == (planned.ours_interval == 1) else Response.SECOND


def looks_findings(data: TaskData[LooksTrial], options: AnalysisOptions) -> Analysis:
    """Return how many participants preferred the modulated version more often than not, and an exact test.

    Answers of one person are not independent, people are: each counts once, and not at all if undecided.
    """
    balance: Counter[str] = Counter()
    for trial in data.trials:
        balance[trial.participant_id] += 1 if trial.prefers_ours else -1
    decided = [score > 0 for score in balance.values() if score != 0]
    if not decided:
        raise evenlight.InputError("no participant preferred one version more often than the other")
    ours, people = sum(decided), len(decided)
    low, high = clopper_pearson(ours, people)
    p = exact_p(ours, people)
    origin = Origin.SIMULATED if data.simulated else Origin.RECORDED
    share = Statistic(
        "preference", "all", "participants who prefer ours", ours / people, "1", origin,
        low, high, 0.95, p, n=people, method="exact binomial test against one half",
    )  # fmt: skip
    lead = f"{ours} of {people} participants preferred the modulated version (exact binomial p = {p:.3g})."
    row = (f"{ours} of {people}", f"{ours / people:.2f}", f"{low:.2f} to {high:.2f}", f"{p:.3g}")
    table = Table("Who prefers the modulated version", ("count", "share", "95 % CI", "p"), (row,))
    section = Section("Which looks better?", (lead,), (table,), simulated=data.simulated)
    return Analysis("which_looks_better", lead, (share,), (), (section,), data.warnings)


INSTRUCTIONS = """\
# Your task

You see the same video twice, marked 1 and 2. Then you are asked which of the two looks better.

Press {first} for the first, {second} for the second. Press {proceed} to begin with practice.
"""
evenlight.register_task(
    evenlight.TaskDeclaration(
        name="which_looks_better",
        title="Which looks better",
        design=LooksDesign,
        trial=LooksTrial,
        task=LooksTask,
        observer=Judges,
        findings=looks_findings,
        pages={
            "en": {
                "instructions": INSTRUCTIONS,
                "question": "Which of the two looks better?\n\nPress {first} or {second}.",
            }
        },
    )
)
