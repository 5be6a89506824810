"""What a task of your own is made of, and its analysis: all that the two examples use, under one name.

`docs/extending.md` is the guide. These names stay; the modules that they come from may change.
"""

from evenlight.analysis.dataset_findings import AnalysisOptions
from evenlight.analysis.inference.binomial_tests import clopper_pearson, exact_p
from evenlight.analysis.report import Section, Table
from evenlight.analysis.results import Analysis
from evenlight.analysis.session_loading import TaskData
from evenlight.data_schema.analysis_results import Origin, Statistic
from evenlight.data_schema.quantities import as_in, described, quantity, record
from evenlight.data_schema.recordings.ramp import RampDesign, RampTrial, Response, Trial, TrialFlag
from evenlight.data_schema.recordings.rig import Keys
from evenlight.data_schema.recordings.viewing import ComparisonDesign, ComparisonTrial, Version
from evenlight.experiments.chance import Purpose, generator_for
from evenlight.experiments.sessions.fixed_order import FixedOrder, PlannedTrial
from evenlight.experiments.sessions.pages import Pages
from evenlight.experiments.sessions.task import (
    ConductedTrial,
    Participant,
    SessionSetting,
    Task,
    TrialPlace,
    shown_columns,
)
from evenlight.experiments.stage import Clip, RampInterval, SearchView, Stage
from evenlight.experiments.viewing.comparison_task import comparison_order, comparison_practice
from evenlight.experiments.viewing.simulated_viewers import Viewing
from evenlight.experiments.viewing.viewing_task import ClipTask, clip_log
from evenlight.method.contrast.luminance import dimmed_luminance

__all__ = [
    "Analysis",
    "AnalysisOptions",
    "Clip",
    "ClipTask",
    "ComparisonDesign",
    "ComparisonTrial",
    "ConductedTrial",
    "FixedOrder",
    "Keys",
    "Origin",
    "Pages",
    "Participant",
    "PlannedTrial",
    "Purpose",
    "RampDesign",
    "RampInterval",
    "RampTrial",
    "Response",
    "SearchView",
    "Section",
    "SessionSetting",
    "Stage",
    "Statistic",
    "Table",
    "Task",
    "TaskData",
    "Trial",
    "TrialFlag",
    "TrialPlace",
    "Version",
    "Viewing",
    "as_in",
    "clip_log",
    "clopper_pearson",
    "comparison_order",
    "comparison_practice",
    "described",
    "dimmed_luminance",
    "exact_p",
    "generator_for",
    "quantity",
    "record",
    "shown_columns",
]
