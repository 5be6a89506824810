"""The table of all kinds of file: the record that each holds, its format, its names, and what writes it."""

from __future__ import annotations

import enum
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from evenlight.data_schema.analysis_results import (
    AnalysisSummary,
    PlottedPoint,
    RampPlanRow,
    Statistic,
    ViewingPlanRow,
)
from evenlight.data_schema.contrast_model import ContrastModel
from evenlight.data_schema.display import Display
from evenlight.data_schema.mapping import words_of
from evenlight.data_schema.power_model import PowerModel
from evenlight.data_schema.rate_limit import RateLimit
from evenlight.data_schema.recordings.headset import HeadsetLog
from evenlight.data_schema.recordings.instrument_logs import (
    BacklightSetting,
    ClockPing,
    FlashMark,
    MeterReading,
    PlayedFlip,
    PowerLog,
    PowerSample,
)
from evenlight.data_schema.recordings.played_power import (
    DevicePass,
    DeviceSaving,
    FrameEnergy,
    PlayedPower,
)
from evenlight.data_schema.recordings.rig import Rig
from evenlight.data_schema.recordings.session import BUILT_IN_TASKS, TASKS, SessionEvent, SessionManifest
from evenlight.data_schema.recordings.study import Study
from evenlight.data_schema.recordings.sweep import (
    LuminanceReading,
    LuminanceSweepDesign,
    PowerReading,
    PowerSweepDesign,
    SweepManifest,
)
from evenlight.data_schema.recordings.sweep_fit import DisplayFit, LuminanceLevel, PowerFit
from evenlight.data_schema.result_request import ResultRequest
from evenlight.data_schema.threshold import Threshold
from evenlight.data_schema.tracks.brightness_track import (
    BrightnessTrack,
    ExportedTrack,
    TrackHeader,
    VideoSection,
)
from evenlight.data_schema.tracks.catalogue import (
    CatalogueResult,
    CatalogueRow,
)
from evenlight.data_schema.tracks.control import (
    LiveControl,
    LiveRefresh,
)
from evenlight.data_schema.tracks.judgement import Judgement
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary


class FileFormat(enum.Enum):
    """How a record lies in a file."""

    TOML = "toml"
    JSON = "json"
    JSON_LINES = "jsonl"  # one record per line
    CSV = "csv"  # one record per row
    NPZ = "npz"  # arrays


_TOML, _JSON, _LINES, _CSV, _NPZ = FileFormat


@dataclass(frozen=True, slots=True)
class RecordKind:
    """A record that is a file, or a line or row of one.

    Attributes
    ----------
    record : type
        Its class.
    file_format : FileFormat
        How it lies in a file.
    patterns : str
        Patterns of the names that such a file has, with spaces between them.
    origin : str
        What writes the file.
    """

    record: type[Any]
    file_format: FileFormat
    patterns: str
    origin: str

    @property
    def name(self) -> str:
        """Its name, the class's in small letters; `schemas/<name>.json` is its JSON Schema."""
        return self.words.replace(" ", "_")

    @property
    def words(self) -> str:
        """Its name in words."""
        return words_of(self.record)

    @property
    def file_names(self) -> tuple[str, ...]:
        """Patterns of the names that such a file has."""
        return tuple(self.patterns.split())


def _designs(tasks: Iterable[str]) -> tuple[RecordKind, ...]:
    """Return the kinds of the designs of tasks; the names of ramp designs have no task in them."""
    names = "design.toml *.design.toml"
    return tuple(
        RecordKind(
            TASKS[task].design,
            _TOML,
            names if task == "ramp" else f"{names} *.{task}.design.toml",
            "an experimenter",
        )
        for task in tasks
    )


def _trials(tasks: Iterable[str]) -> tuple[RecordKind, ...]:
    """Return the kinds of the trials and frames of tasks; several may have the same kind of frames."""
    writers: dict[tuple[type[Any], str], list[str]] = {}
    for task in tasks:
        for record, name in ((TASKS[task].trial, "trials.jsonl"), (TASKS[task].frames, "frames.jsonl")):
            writers.setdefault((record, name), []).append(f"`{task}`")
    return tuple(
        RecordKind(record, _LINES, name, f"the experiment{'s' * (len(of) > 1)} {' and '.join(of)}")
        for (record, name), of in writers.items()
    )


# Of several that a name fits equally well, the keys tell which it is; the first, if they tell nothing.
KINDS = (
    RecordKind(Display, _TOML, "display.toml *.display.toml", "a luminance sweep, or by hand"),
    RecordKind(PowerModel, _TOML, "power.toml power_model.toml *.power.toml", "a power sweep, or by hand"),
    RecordKind(ContrastModel, _TOML, "contrast_model.toml *.contrast_model.toml", "a researcher"),
    RecordKind(Rig, _TOML, "rig.toml *.rig.toml", "an experimenter"),
    RecordKind(
        ResultRequest,
        _TOML,
        "request.toml *.request.toml",
        "`evenlight optimize`, `control`, `catalogue`, `judge`, `fit`, `analyze`",
    ),
    RecordKind(Study, _TOML, "study.toml *.study.toml", "`evenlight new study`, and an experimenter"),
    RecordKind(SessionManifest, _JSON, "manifest.json", "an experiment, or `evenlight import`"),
    *_designs(BUILT_IN_TASKS),
    *_trials(BUILT_IN_TASKS),
    RecordKind(HeadsetLog, _LINES, "headset.jsonl", "an experiment in a headset"),
    RecordKind(SessionEvent, _LINES, "events.jsonl", "an experiment"),
    RecordKind(Threshold, _CSV, "thresholds.csv", "`evenlight fit`"),
    RecordKind(RateLimit, _JSON, "rate_limit.json *.rate_limit.json", "`evenlight fit`"),
    RecordKind(LossCurves, _NPZ, "loss_curves.npz *.npz", "`evenlight optimize`"),
    RecordKind(BrightnessTrack, _CSV, "track.csv", "`evenlight optimize`"),
    RecordKind(TrackHeader, _JSON, "track.json", "`evenlight optimize`"),
    RecordKind(
        ExportedTrack,
        _JSON,
        "exported_track.json *.exported_track.json",
        "`evenlight track export --to json`",
    ),
    RecordKind(OptimizationSummary, _JSON, "summary.json", "`evenlight optimize`, `control`"),
    RecordKind(LuminanceSweepDesign, _TOML, "*.design.toml *.luminance-sweep.design.toml", "an experimenter"),
    RecordKind(PowerSweepDesign, _TOML, "*.design.toml *.power-sweep.design.toml", "an experimenter"),
    RecordKind(SweepManifest, _JSON, "sweep.json", "a sweep of `evenlight run`"),
    RecordKind(LuminanceReading, _LINES, "readings.jsonl", "`evenlight run luminance-sweep`"),
    RecordKind(PowerReading, _LINES, "readings.jsonl", "`evenlight run power-sweep`"),
    RecordKind(
        LuminanceLevel,
        _CSV,
        "luminance_levels.csv brightness.csv",
        "`evenlight fit` (`luminance_levels.csv`: earlier versions)",
    ),
    RecordKind(DisplayFit, _JSON, "display_fit.json", "`evenlight fit`"),
    RecordKind(PowerFit, _JSON, "power_fit.json", "`evenlight fit`"),
    RecordKind(PowerLog, _JSON, "power_log.json", "`evenlight measure played`"),
    RecordKind(
        PowerSample,
        _CSV,
        "power.csv",
        "`evenlight measure played`, `evenlight measure power` and `saving`",
    ),
    RecordKind(MeterReading, _CSV, "luminance.csv", "`evenlight measure luminance`"),
    RecordKind(ClockPing, _CSV, "clock.csv", "`evenlight measure played`"),
    RecordKind(PlayedFlip, _CSV, "flips.csv", "`evenlight measure played`"),
    RecordKind(FlashMark, _CSV, "flashes.csv", "`evenlight measure played`"),
    RecordKind(BacklightSetting, _CSV, "backlight.csv", "`evenlight measure played`"),
    RecordKind(FrameEnergy, _CSV, "frame_energy.csv", "`evenlight measure played`"),
    RecordKind(PlayedPower, _JSON, "played_power.json", "`evenlight measure played`"),
    RecordKind(DevicePass, _CSV, "passes.csv", "`evenlight measure saving`"),
    RecordKind(DeviceSaving, _JSON, "saving.json", "`evenlight measure saving`"),
    RecordKind(Statistic, _CSV, "*_statistics.csv", "`evenlight analyze`, `evenlight reproduce`"),
    RecordKind(PlottedPoint, _CSV, "*_points.csv", "`evenlight analyze`, `evenlight reproduce`"),
    RecordKind(
        AnalysisSummary,
        _JSON,
        "analysis.json reproduction.json",
        "`evenlight analyze`, `evenlight reproduce`",
    ),
    RecordKind(RampPlanRow, _CSV, "plan.csv", "`evenlight plan ramp`"),
    RecordKind(ViewingPlanRow, _CSV, "plan.csv", "`evenlight plan rating`, `comparison` and `search`"),
    RecordKind(CatalogueRow, _CSV, "catalogue.csv", "`evenlight catalogue`"),
    RecordKind(CatalogueResult, _JSON, "catalogue.json", "`evenlight catalogue`"),
    RecordKind(
        VideoSection,
        _CSV,
        "weights.csv *.weights.csv allowances.csv *.allowances.csv",
        "someone who knows the video",
    ),
    RecordKind(Judgement, _JSON, "judgement.json", "`evenlight judge`"),
    RecordKind(LiveRefresh, _CSV, "live_control.csv", "`evenlight walk` with `--target-loss` or `--budget`"),
    RecordKind(
        LiveControl, _JSON, "live_control.json", "`evenlight walk` with `--target-loss` or `--budget`"
    ),
)
KIND_OF: dict[type[Any], RecordKind] = {kind.record: kind for kind in KINDS}
# The kind of the lines of readings.jsonl, by the manifest's task.
READINGS_OF_SWEEP = {"luminance-sweep": KIND_OF[LuminanceReading], "power-sweep": KIND_OF[PowerReading]}


def known_kinds() -> tuple[RecordKind, ...]:
    """Return all kinds of file: those of Evenlight, and those of registered tasks."""
    others = [task for task in TASKS if task not in BUILT_IN_TASKS]
    return KINDS + tuple(kind for kind in (*_designs(others), *_trials(others)) if kind.record not in KIND_OF)


def kind_of(record: type[Any] | None) -> RecordKind | None:
    """Return the kind of file that holds a record, None if there is none."""
    return next((kind for kind in known_kinds() if kind.record is record), None)
