"""Checking whatever is at a path: a file, a data set, a folder of results, or a folder of all these.

The files of an optimization are compared with each other: track, header, summary and loss curves.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Collection, Iterable, Iterator
from fnmatch import fnmatchcase
from pathlib import Path

from evenlight.data_schema.checking.dataset_checks import check_dataset, is_dataset
from evenlight.data_schema.checking.file_checks import CheckedFile, check_file
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.mapping import keys_of
from evenlight.data_schema.quantities import Array
from evenlight.data_schema.record_kinds import FileFormat, RecordKind, known_kinds
from evenlight.data_schema.recordings.dataset_layout import PREREGISTRATIONS
from evenlight.data_schema.recordings.study import read_preregistration
from evenlight.data_schema.storage.result_folders import SUMS, changed_in
from evenlight.data_schema.storage.text_files import parse_json, read_text, read_toml
from evenlight.data_schema.tracks.brightness_track import DERIVED, TRACK_COLUMNS, BrightnessTrack
from evenlight.data_schema.tracks.control import LOOKAHEAD, ONLINE
from evenlight.data_schema.tracks.loss_curves import LossCurves
from evenlight.data_schema.tracks.optimization_summary import OptimizationSummary

KNOWN = (
    "a data set (dataset_description.json, sub-* folders), results of `evenlight optimize` or "
    "`evenlight fit`, or a display, power model, rate limit or design file"
)
# Tables that commands read by rules of their own; files of earlier versions that are others now, or gone.
NO_RECORDS = (
    "*.catalogue.csv",
    "*.published.csv",
    *("agreement.csv", "control.json", "errors.csv", "judgement.csv", "power_table.csv", "tuning.json"),
    *("benchmark.json", "power_levels.csv"),
)
LIKENESS = 0.5  # share of keys that a file must have in common with a record to be taken for one
TOLERANCE = 1e-6  # relative; the order of summation is not the writer's


def validate(path: Path) -> Iterator[CheckedFile]:
    """Yield every file at a path, with all that is wrong with it.

    Parameters
    ----------
    path : Path
        A file; or a folder, which is searched through. A file that its name does not identify is recognized
        by its keys; files that are no record are yielded without words, hidden ones not at all.

    Raises
    ------
    InputError
        If there is nothing at the path, or a single file that is no record.
    """
    if path.is_dir():
        yield from _check_folder(path)
        return
    if fnmatchcase(path.name, PREREGISTRATIONS):
        yield _checked_preregistration(path)
        return
    kind = _kind_of(path)
    if kind is None:
        read_text(path, KNOWN)  # if it cannot be read, that is what is wrong
        raise InputError(f"{path}: nothing that Evenlight knows; expected {KNOWN}")
    yield check_file(path, kind)


def _check_folder(folder: Path) -> Iterator[CheckedFile]:
    if is_dataset(folder):
        yield from _check_dataset_folder(folder)
        return
    files, folders = _members(folder)
    checked = [_check_member(path) for path in files]
    compare_results(checked)
    yield from checked
    for inner in folders:
        yield from _check_folder(inner)


def _check_dataset_folder(dataset: Path) -> Iterator[CheckedFile]:
    done = set()
    for checked in check_dataset(dataset):
        done.add(checked.path)
        yield checked
    waiting = [dataset]
    while waiting:
        files, folders = _members(waiting.pop(0))
        yield from (_check_member(path) for path in files if path not in done)
        waiting += folders


def _members(folder: Path) -> tuple[list[Path], list[Path]]:
    """Return the files and the folders in a folder, in order; without hidden ones, and links to folders."""
    try:
        paths = sorted(path for path in folder.iterdir() if not path.name.startswith("."))
    except OSError as error:
        raise InputError(f"{folder}: cannot be read ({error.strerror or error})") from error
    folders = [path for path in paths if path.is_dir()]
    return [p for p in paths if p not in folders], [p for p in folders if not p.is_symlink()]


def _check_member(path: Path) -> CheckedFile:
    if path.name == SUMS:
        checked = CheckedFile(path, "sums of a result")
        for name in changed_in(path.parent):
            checked.blame(f"{name}: is not as it was when this result was written")
        return checked
    if fnmatchcase(path.name, PREREGISTRATIONS):
        return _checked_preregistration(path)
    try:
        kind = _kind_of(path)
    except InputError:
        kind = None  # no record, as far as its name tells, and not readable as one
    return check_file(path, kind) if kind else CheckedFile(path, "")


def _checked_preregistration(path: Path) -> CheckedFile:
    checked = CheckedFile(path, "a pre-registration")
    try:
        checked.records.append((0, read_preregistration(path)))
    except InputError as error:
        checked.problems.append(str(error))
    return checked


def _kind_of(path: Path) -> RecordKind | None:
    if any(fnmatchcase(path.name, pattern) for pattern in NO_RECORDS):
        return None
    named = kinds_by_name(path)
    if len(named) == 1:
        return named[0]
    formats = {f".{member.value}": member for member in FileFormat}
    found = formats.get(path.suffix.lower())
    if named and found:
        try:
            return likeliest(named, _keys_in(path, found))
        except InputError:
            return named[0]  # it is to be that, and cannot be read as anything
    return kind_by_keys(found, _keys_in(path, found)) if found else None


def _keys_in(path: Path, file_format: FileFormat) -> set[str]:
    if file_format is FileFormat.TOML:
        return set(read_toml(path, KNOWN))
    text = read_text(path, KNOWN)
    if file_format is FileFormat.CSV:
        return set(next(csv.reader(io.StringIO(text[:10_000])), []))
    if file_format is FileFormat.JSON_LINES:
        text = text.partition("\n")[0]
    content = parse_json(text, str(path), KNOWN)
    return set(content) if isinstance(content, dict) else set()


def kinds_by_name(path: Path) -> list[RecordKind]:
    """Return the kinds of record that a file of this name may hold: of those with the longest pattern.

    >>> [kind.name for kind in kinds_by_name(Path("lab/my.search.design.toml"))]
    ['search_design']
    """
    fitting = {
        kind.name: max((len(p) for p in kind.file_names if fnmatchcase(path.name, p)), default=0)
        for kind in known_kinds()
    }
    longest = max(fitting.values())
    return [kind for kind in known_kinds() if longest and fitting[kind.name] == longest]


def kind_by_keys(file_format: FileFormat, keys: Collection[str]) -> RecordKind | None:
    """Return the kind of record that has most of these keys, or None if none has enough.

    A misspelt or missing key among several does not matter: the file is to be recognized, then checked.

    >>> kind_by_keys(FileFormat.TOML, {"kind", "base_power_w", "name"}).name
    'power_model'
    """
    best = likeliest((kind for kind in known_kinds() if kind.file_format is file_format), keys)
    return best if best and _likeness(best, keys) >= LIKENESS else None


def likeliest(kinds: Iterable[RecordKind], keys: Collection[str]) -> RecordKind | None:
    """Return which of some kinds has most of these keys; the first of several, None if there is no kind."""
    return max(kinds, key=lambda kind: _likeness(kind, keys), default=None)


def _likeness(kind: RecordKind, keys: Collection[str]) -> float:
    """Return the keys in common as a share of those found or required."""
    if kind.record is BrightnessTrack:
        known = required = set(TRACK_COLUMNS)
    else:
        known, required = map(set, keys_of(kind.record))
    return len(known & set(keys)) / max(len(required | set(keys)), 1)


def compare_results(files: list[CheckedFile]) -> None:
    """Note where the files of a folder contradict each other; those with problems of their own are left out.

    Parameters
    ----------
    files : list of CheckedFile
        The checked files of one folder; problems are added to them.
    """
    records = {type(checked.record): checked for checked in files if checked.record is not None}
    if BrightnessTrack not in records:
        return
    track: BrightnessTrack = records[BrightnessTrack].records[0][1]
    if OptimizationSummary in records:
        _compare_header(records[OptimizationSummary], track, records[BrightnessTrack].path)
        _compare_figures(records[OptimizationSummary], track)
        _compare_promises(records[OptimizationSummary], track)
    if LossCurves in records:
        _compare_curves(records[LossCurves], track)


def _compare_header(checked: CheckedFile, track: BrightnessTrack, path: Path) -> None:
    summary: OptimizationSummary = checked.records[0][1]
    header, name = track.header, path.with_suffix(".json").name
    pairs = (
        ("video", summary.video, header.video),
        ("display", summary.display, header.display_name),
        ("rate_limit", summary.rate_limit, header.rate_limit),
        ("power_model", summary.power_model, header.power_model),
        ("budget", summary.budget, header.budget),
        ("budget_unit", summary.budget_unit.value, header.budget_unit.value),
        ("solver", summary.solver, header.solver),
    )
    for key, got, other in pairs:
        if got != other:
            checked.blame(f"{key}: expected {other!r}, as in {name}, got {got!r}")
    if summary.frames != len(track.factors):
        checked.blame(f"frames: expected {len(track.factors)}, the rows of {path.name}, got {summary.frames}")


def _compare_figures(checked: CheckedFile, track: BrightnessTrack) -> None:
    """Note figures of a summary that do not follow from the track's columns.

    A mean over time lies between the extremes of its column, whatever the durations of the frames.
    """
    summary: OptimizationSummary = checked.records[0][1]
    for key, mean, column in (
        ("mean_factor", summary.mean_factor, track.factors),
        ("mean_contrast_loss", summary.mean_contrast_loss, track.contrast_loss),
        ("mean_power_w", summary.mean_power, track.power),
    ):
        if mean is None or column is None:
            if (mean is None) != (column is None):
                checked.blame(f"{key}: expected what the track's column has, a power or none, got {mean}")
            continue
        low, high = float(column.min()), float(column.max())
        if not low - TOLERANCE * abs(low) <= mean <= high + TOLERANCE * abs(high):
            checked.blame(f"{key}: expected {low:g} to {high:g}, as the track's column reaches, got {mean:g}")
    if summary.frames != len(track.factors):
        return
    objective = mean_absolute_difference(track.contrast_loss)
    weighted = "weights" in summary.provenance.inputs  # then pairs of frames count differently
    if not weighted and abs(summary.objective - objective) > TOLERANCE * max(objective, 1e-3):
        checked.blame(
            f"objective: expected {objective:.6g}, the mean absolute difference of the track's "
            f"contrast_loss, got {summary.objective:.6g}"
        )


def _compare_promises(checked: CheckedFile, track: BrightnessTrack) -> None:
    """Note promises of a summary that it or the track's columns break: budget, baseline, rate limit."""
    summary: OptimizationSummary = checked.records[0][1]
    # Online control promises neither budget nor baseline, nor does one of several clips that share a budget.
    planned = summary.solver not in (ONLINE, LOOKAHEAD) and summary.clips == 1
    if planned and abs(summary.achieved - summary.budget) > TOLERANCE:
        checked.blame(f"achieved: expected the budget {summary.budget:g}, got {summary.achieved:g}")
    if planned and summary.objective > summary.objective_baseline + TOLERANCE:
        checked.blame(
            f"objective: expected at most {summary.objective_baseline:g}, that of constant dimming, "
            f"got {summary.objective:g}"
        )
    steps = zip(track.rate.tolist(), track.rate_limit.tolist(), strict=True)
    ratio = max((abs(rate) / limit if limit else math.inf for rate, limit in steps if rate), default=0.0)
    if abs(ratio - summary.max_rate_ratio) > TOLERANCE * max(ratio, 1.0):
        checked.blame(f"max_rate_ratio: expected {ratio:g}, as in the track, got {summary.max_rate_ratio:g}")
    if ratio > 1 + TOLERANCE:
        checked.blame(f"max_rate_ratio: expected at most 1, the track's fastest step has {ratio:g}")


def mean_absolute_difference(values: Array) -> float:
    """Return the mean of |x_i - x_j| over all pairs; 0 for a single value.

    In order of size the k-th of n values is the greater one in k pairs and the smaller one in n - 1 - k.

    >>> import numpy as np
    >>> round(mean_absolute_difference(np.array([0.0, 1.0, 3.0])), 12)  # (1 + 3 + 2) / 3
    2.0
    """
    import numpy as np

    n = len(values)
    if n < 2:
        return 0.0
    return float(np.sort(values) @ (2 * np.arange(n) - (n - 1))) / (n * (n - 1) / 2)


def _compare_curves(checked: CheckedFile, track: BrightnessTrack) -> None:
    curves: LossCurves = checked.records[0][1]
    if curves.n_frames == len(track.factors):
        shown = track.factors * curves.mean_luminance + curves.display.reflected_luminance
        wrong = abs(track.mean_luminance - shown) > DERIVED * shown
        if wrong.any():
            k = int(wrong.argmax())
            checked.blame(
                f"mean_luminance of frame {k}: the track's factor makes {shown[k]:g} cd/m^2 of it, and its "
                f"mean_luminance_cd_m2 is {track.mean_luminance[k]:g}"
            )
    for key, got, other in (
        ("video", curves.video, track.header.video),
        ("display fingerprint", curves.display.fingerprint, track.header.display_fingerprint),
    ):
        if got != other:
            checked.blame(f"{key}: expected {other!r}, as in the track's header, got {got!r}")
