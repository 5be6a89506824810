"""The list of all kinds of file: the record that each holds, the names it goes by, and who writes it."""

from __future__ import annotations

from evenlight.data_schema.analysis_summary import AnalysisSummary
from evenlight.data_schema.benchmark import BenchmarkClaim, BenchmarkGrowth, BenchmarkPoint, BenchmarkSummary
from evenlight.data_schema.brightness_track import BrightnessTrack, OptimizationSummary, TrackHeader
from evenlight.data_schema.contrast_model import ContrastModel
from evenlight.data_schema.control import ControlSummary, TargetRow, TuningReport
from evenlight.data_schema.display import Display
from evenlight.data_schema.frame_energy import FrameEnergy
from evenlight.data_schema.frame_log import FrameLog
from evenlight.data_schema.live_control import LiveControl, LiveRefresh
from evenlight.data_schema.loss_curves import LossCurves
from evenlight.data_schema.meter_reading import MeterReading
from evenlight.data_schema.plan import RampPlanRow, ViewingPlanRow
from evenlight.data_schema.played_power import PlayedPower, VersionPower
from evenlight.data_schema.power_log import (
    BacklightSetting,
    ClockPing,
    FlashMark,
    PlayedFlip,
    PowerLog,
    PowerSample,
)
from evenlight.data_schema.power_model import PowerModel
from evenlight.data_schema.published_value import PublishedValue
from evenlight.data_schema.ramp import RampDesign, RampTrial
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.record_kind import FileFormat, RecordKind
from evenlight.data_schema.rig import Rig
from evenlight.data_schema.search import SearchDesign, SearchTrial, ViewLog
from evenlight.data_schema.section import AllowanceSection, WeightSection
from evenlight.data_schema.session import SessionEvent, SessionManifest
from evenlight.data_schema.statistic import PlottedPoint, Statistic
from evenlight.data_schema.sweep import (
    LuminanceReading,
    LuminanceSweepDesign,
    PowerReading,
    PowerSweepDesign,
    SweepManifest,
)
from evenlight.data_schema.sweep_fit import DisplayFit, LuminanceLevel, PowerFit, PowerLevel
from evenlight.data_schema.threshold import Threshold
from evenlight.data_schema.viewing import (
    ClipLog,
    ComparisonDesign,
    ComparisonTrial,
    RatingDesign,
    RatingTrial,
)

DISPLAY = RecordKind(
    "display", Display, FileFormat.TOML, ("display.toml", "*.display.toml"), "a luminance sweep, or by hand"
)
POWER_MODEL = RecordKind(
    "power_model",
    PowerModel,
    FileFormat.TOML,
    ("power.toml", "power_model.toml", "*.power.toml"),
    "a power sweep, or by hand",
)
CONTRAST_MODEL = RecordKind(
    "contrast_model",
    ContrastModel,
    FileFormat.TOML,
    ("contrast_model.toml", "*.contrast_model.toml"),
    "a researcher",
)
RAMP_DESIGN = RecordKind(
    "ramp_design", RampDesign, FileFormat.TOML, ("design.toml", "*.design.toml"), "an experimenter"
)
RIG = RecordKind("rig", Rig, FileFormat.TOML, ("rig.toml", "*.rig.toml"), "an experimenter")
RATE_LIMIT = RecordKind(
    "rate_limit", RateLimit, FileFormat.JSON, ("rate_limit.json", "*.rate_limit.json"), "`evenlight fit`"
)
THRESHOLD = RecordKind("threshold", Threshold, FileFormat.CSV, ("thresholds.csv",), "`evenlight fit`")
TRACK_HEADER = RecordKind(
    "track_header", TrackHeader, FileFormat.JSON, ("track.json",), "`evenlight optimize`"
)
BRIGHTNESS_TRACK = RecordKind(
    "brightness_track", BrightnessTrack, FileFormat.CSV, ("track.csv",), "`evenlight optimize`"
)
OPTIMIZATION_SUMMARY = RecordKind(
    "optimization_summary", OptimizationSummary, FileFormat.JSON, ("summary.json",), "`evenlight optimize`"
)
LOSS_CURVES = RecordKind(
    "loss_curves", LossCurves, FileFormat.NPZ, ("loss_curves.npz", "*.npz"), "`evenlight optimize`"
)
SESSION_MANIFEST = RecordKind(
    "session_manifest", SessionManifest, FileFormat.JSON, ("manifest.json",), "an experiment"
)
RAMP_TRIAL = RecordKind(
    "ramp_trial", RampTrial, FileFormat.JSON_LINES, ("trials.jsonl",), "the experiment `ramp`"
)
FRAME_LOG = RecordKind(
    "frame_log", FrameLog, FileFormat.JSON_LINES, ("frames.jsonl",), "an experiment with a window"
)
RATING_DESIGN = RecordKind(
    "rating_design", RatingDesign, FileFormat.TOML, ("design.toml", "*.design.toml", "*.rating.design.toml"),
    "an experimenter",
)  # fmt: skip
COMPARISON_DESIGN = RecordKind(
    "comparison_design", ComparisonDesign, FileFormat.TOML,
    ("design.toml", "*.design.toml", "*.comparison.design.toml"), "an experimenter",
)  # fmt: skip
SEARCH_DESIGN = RecordKind(
    "search_design", SearchDesign, FileFormat.TOML, ("design.toml", "*.design.toml", "*.search.design.toml"),
    "an experimenter",
)  # fmt: skip
RATING_TRIAL = RecordKind(
    "rating_trial", RatingTrial, FileFormat.JSON_LINES, ("trials.jsonl",), "the experiment `rating`"
)
COMPARISON_TRIAL = RecordKind(
    "comparison_trial",
    ComparisonTrial,
    FileFormat.JSON_LINES,
    ("trials.jsonl",),
    "the experiment `comparison`",
)
SEARCH_TRIAL = RecordKind(
    "search_trial", SearchTrial, FileFormat.JSON_LINES, ("trials.jsonl",), "the experiment `search`"
)
CLIP_LOG = RecordKind(
    "clip_log", ClipLog, FileFormat.JSON_LINES, ("frames.jsonl",), "the experiments `rating` and `comparison`"
)
VIEW_LOG = RecordKind(
    "view_log", ViewLog, FileFormat.JSON_LINES, ("frames.jsonl",), "the experiment `search`"
)
SESSION_EVENT = RecordKind(
    "session_event", SessionEvent, FileFormat.JSON_LINES, ("events.jsonl",), "an experiment"
)
LUMINANCE_SWEEP_DESIGN = RecordKind(
    "luminance_sweep_design", LuminanceSweepDesign, FileFormat.TOML,
    ("*.design.toml", "*.luminance-sweep.design.toml"), "whoever measures a display",
)  # fmt: skip
POWER_SWEEP_DESIGN = RecordKind(
    "power_sweep_design", PowerSweepDesign, FileFormat.TOML,
    ("*.design.toml", "*.power-sweep.design.toml"), "whoever measures a display",
)  # fmt: skip
SWEEP_MANIFEST = RecordKind(
    "sweep_manifest", SweepManifest, FileFormat.JSON, ("sweep.json",), "a sweep of `evenlight run`"
)
LUMINANCE_READING = RecordKind(
    "luminance_reading",
    LuminanceReading,
    FileFormat.JSON_LINES,
    ("readings.jsonl",),
    "`evenlight run luminance-sweep`",
)
POWER_READING = RecordKind(
    "power_reading", PowerReading, FileFormat.JSON_LINES, ("readings.jsonl",), "`evenlight run power-sweep`"
)
LUMINANCE_LEVEL = RecordKind(
    "luminance_level",
    LuminanceLevel,
    FileFormat.CSV,
    ("luminance_levels.csv", "brightness.csv"),
    "`evenlight fit`",
)
POWER_LEVEL = RecordKind("power_level", PowerLevel, FileFormat.CSV, ("power_levels.csv",), "`evenlight fit`")
DISPLAY_FIT = RecordKind("display_fit", DisplayFit, FileFormat.JSON, ("display_fit.json",), "`evenlight fit`")
POWER_FIT = RecordKind("power_fit", PowerFit, FileFormat.JSON, ("power_fit.json",), "`evenlight fit`")
POWER_LOG = RecordKind(
    "power_log", PowerLog, FileFormat.JSON, ("power_log.json",), "`evenlight play --measure-power`"
)
POWER_SAMPLE = RecordKind(
    "power_sample",
    PowerSample,
    FileFormat.CSV,
    ("power.csv",),
    "`evenlight play --measure-power`, `evenlight measure power`",
)
METER_READING = RecordKind(
    "meter_reading", MeterReading, FileFormat.CSV, ("luminance.csv",), "`evenlight measure luminance`"
)
CLOCK_PING = RecordKind(
    "clock_ping", ClockPing, FileFormat.CSV, ("clock.csv",), "`evenlight play --measure-power`"
)
PLAYED_FLIP = RecordKind(
    "played_flip", PlayedFlip, FileFormat.CSV, ("flips.csv",), "`evenlight play --measure-power`"
)
BACKLIGHT_SETTING = RecordKind(
    "backlight_setting",
    BacklightSetting,
    FileFormat.CSV,
    ("backlight.csv",),
    "`evenlight play --measure-power`",
)
FLASH_MARK = RecordKind(
    "flash_mark", FlashMark, FileFormat.CSV, ("flashes.csv",), "`evenlight play --measure-power`"
)

FRAME_ENERGY = RecordKind(
    "frame_energy", FrameEnergy, FileFormat.CSV, ("frame_energy.csv",), "`evenlight play --measure-power`"
)
VERSION_POWER = RecordKind(
    "version_power", VersionPower, FileFormat.CSV, ("power_table.csv",), "`evenlight play --measure-power`"
)
PLAYED_POWER = RecordKind(
    "played_power",
    PlayedPower,
    FileFormat.JSON,
    ("played_power.json",),
    "`evenlight play --measure-power`",
)

STATISTIC = RecordKind(
    "statistic",
    Statistic,
    FileFormat.CSV,
    ("*_statistics.csv",),
    "`evenlight analyze`, `evenlight audit`, `evenlight reproduce`",
)
PLOTTED_POINT = RecordKind(
    "plotted_point",
    PlottedPoint,
    FileFormat.CSV,
    ("*_points.csv",),
    "`evenlight analyze`, `evenlight audit`, `evenlight reproduce`",
)
ANALYSIS_SUMMARY = RecordKind(
    "analysis_summary",
    AnalysisSummary,
    FileFormat.JSON,
    ("analysis.json", "audit.json", "reproduction.json"),
    "`evenlight analyze`, `evenlight audit`, `evenlight reproduce`",
)
PUBLISHED_VALUE = RecordKind(
    "published_value", PublishedValue, FileFormat.CSV, ("*.published.csv",), "whoever read the paper"
)

RAMP_PLAN_ROW = RecordKind(
    "ramp_plan_row", RampPlanRow, FileFormat.CSV, ("plan.csv",), "`evenlight plan ramp`"
)
VIEWING_PLAN_ROW = RecordKind(
    "viewing_plan_row",
    ViewingPlanRow,
    FileFormat.CSV,
    ("plan.csv",),
    "`evenlight plan rating`, `comparison` and `search`",
)

BENCHMARK_POINT = RecordKind(
    "benchmark_point", BenchmarkPoint, FileFormat.CSV, ("*_benchmark.csv",), "`evenlight bench`"
)
BENCHMARK_GROWTH = RecordKind(
    "benchmark_growth", BenchmarkGrowth, FileFormat.CSV, ("*_growth.csv",), "`evenlight bench`"
)
BENCHMARK_CLAIM = RecordKind(
    "benchmark_claim", BenchmarkClaim, FileFormat.CSV, ("*_claims.csv",), "`evenlight bench`"
)
BENCHMARK_SUMMARY = RecordKind(
    "benchmark_summary", BenchmarkSummary, FileFormat.JSON, ("benchmark.json",), "`evenlight bench`"
)

CONTROL_SUMMARY = RecordKind(
    "control_summary", ControlSummary, FileFormat.JSON, ("control.json",), "`evenlight control`"
)
TARGET_ROW = RecordKind(
    "target_row", TargetRow, FileFormat.CSV, ("target_sweep.csv",), "`evenlight control --sweep`"
)
TUNING_REPORT = RecordKind(
    "tuning_report", TuningReport, FileFormat.JSON, ("tuning.json",), "`evenlight control --tune`"
)

WEIGHT_SECTION = RecordKind(
    "weight_section", WeightSection, FileFormat.CSV, ("weights.csv", "*.weights.csv"), "whoever knows a video"
)
ALLOWANCE_SECTION = RecordKind(
    "allowance_section",
    AllowanceSection,
    FileFormat.CSV,
    ("allowances.csv", "*.allowances.csv"),
    "whoever knows a video",
)

LIVE_REFRESH = RecordKind(
    "live_refresh",
    LiveRefresh,
    FileFormat.CSV,
    ("live_control.csv",),
    "`evenlight play --walk` with `--target-loss` or `--budget`",
)
LIVE_CONTROL = RecordKind(
    "live_control",
    LiveControl,
    FileFormat.JSON,
    ("live_control.json",),
    "`evenlight play --walk` with `--target-loss` or `--budget`",
)

# Of several that a name fits equally well, the keys tell which it is; the first, if they tell nothing.
KINDS = (
    DISPLAY,
    POWER_MODEL,
    CONTRAST_MODEL,
    RIG,
    SESSION_MANIFEST,
    RAMP_DESIGN,
    RATING_DESIGN,
    COMPARISON_DESIGN,
    SEARCH_DESIGN,
    RAMP_TRIAL,
    FRAME_LOG,
    RATING_TRIAL,
    COMPARISON_TRIAL,
    CLIP_LOG,
    SEARCH_TRIAL,
    VIEW_LOG,
    SESSION_EVENT,
    THRESHOLD,
    RATE_LIMIT,
    LOSS_CURVES,
    BRIGHTNESS_TRACK,
    TRACK_HEADER,
    OPTIMIZATION_SUMMARY,
    LUMINANCE_SWEEP_DESIGN,
    POWER_SWEEP_DESIGN,
    SWEEP_MANIFEST,
    LUMINANCE_READING,
    POWER_READING,
    LUMINANCE_LEVEL,
    POWER_LEVEL,
    DISPLAY_FIT,
    POWER_FIT,
    POWER_LOG,
    POWER_SAMPLE,
    METER_READING,
    CLOCK_PING,
    PLAYED_FLIP,
    FLASH_MARK,
    BACKLIGHT_SETTING,
    FRAME_ENERGY,
    VERSION_POWER,
    PLAYED_POWER,
    STATISTIC,
    PLOTTED_POINT,
    ANALYSIS_SUMMARY,
    PUBLISHED_VALUE,
    RAMP_PLAN_ROW,
    VIEWING_PLAN_ROW,
    BENCHMARK_POINT,
    BENCHMARK_GROWTH,
    BENCHMARK_CLAIM,
    BENCHMARK_SUMMARY,
    WEIGHT_SECTION,
    ALLOWANCE_SECTION,
    CONTROL_SUMMARY,
    TARGET_ROW,
    TUNING_REPORT,
    LIVE_REFRESH,
    LIVE_CONTROL,
)
# The kind of the lines of trials.jsonl and of frames.jsonl, by the manifest's task.
TRIALS_OF_TASK = {
    "ramp": RAMP_TRIAL,
    "rating": RATING_TRIAL,
    "comparison": COMPARISON_TRIAL,
    "search": SEARCH_TRIAL,
}
READINGS_OF_SWEEP = {"luminance-sweep": LUMINANCE_READING, "power-sweep": POWER_READING}
FRAMES_OF_TASK = {"ramp": FRAME_LOG, "rating": CLIP_LOG, "comparison": CLIP_LOG, "search": VIEW_LOG}
