"""The sections of the report, made from the records that they tell about."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from evenlight.analysis.report import Cell, Section, Table
from evenlight.analysis.report_prose import section
from evenlight.analysis.wording import first_few, sentence
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.roll_call import RollCall, SessionUse

CLAIM = (
    "What is made equal is the loss of visible contrast. Whether frames that lose the same share of it look "
    "equally good, only viewers can say: docs/validity.md tells what is known."
)


def roll_section(roll: RollCall) -> Section:
    """Return who took part: the sessions of a data set by task and status, and which cannot be read."""
    groups = dict.fromkeys((entry.task, entry.status) for entry in roll.sessions)
    rows: list[tuple[Cell, ...]] = []
    for task, status in groups:
        own = [entry for entry in roll.sessions if (entry.task, entry.status) == (task, status)]
        read = [entry for entry in own if entry.use is SessionUse.READ]
        rows.append((task, status or None, len(own), len(read), sum(entry.n_trials for entry in read)))
    columns = ("task", "status", "sessions", "can be read", "trials in them, practice and all")
    table = Table(f"Sessions of the data set {roll.dataset}.", columns, tuple(rows))
    present = {entry.participant_id for entry in roll.sessions if entry.session_id}
    usable = {entry.participant_id for entry in roll.read}
    sources = first_few(list(dict.fromkeys(entry.source for entry in roll.read if entry.source)))
    tables = (table, *_displays(roll))
    said = section("sessions", tables, roll=roll, present=len(present), usable=len(usable), sources=sources)
    return replace(said, notes=roll.warnings)


def _displays(roll: RollCall) -> tuple[Table, ...]:
    """Return a table of which sessions ran on which display and calibration; none if it was one."""
    own: dict[str, list[str]] = {}
    for entry in roll.read:
        own.setdefault(entry.display, []).append(f"{entry.participant_id}/{entry.session_id}")
    if len(own) < 2:
        return ()
    rows = tuple(
        (display.replace("^2", "²") or None, len(names), ", ".join(names)) for display, names in own.items()
    )
    return (Table("Displays and their calibrations.", ("display", "sessions", "participant/session"), rows),)


def plan_section(departures: tuple[str, ...]) -> tuple[Section, ...]:
    """Return how a run departs from its plan, before all else; nothing where nothing was pre-registered."""
    lines = tuple(f"{sentence(words)}." for words in departures)
    return (Section("Departures from the pre-registration", lines),) if lines else ()


def provenance_section(origins: Mapping[str, Provenance]) -> Section:
    """Return software, seeds and inputs of some results.

    Parameters
    ----------
    origins : mapping of str to Provenance
        Where each result comes from, by its name.
    """
    software: list[tuple[Cell, ...]] = []
    inputs: list[tuple[Cell, ...]] = []
    for name, origin in origins.items():
        packages = ", ".join(f"{package} {version}" for package, version in origin.versions.items())
        software.append((name, origin.software_version, origin.software_revision, origin.seed, packages))
        inputs += [(name, what, digest) for what, digest in origin.inputs.items()]
    tables = (
        Table(
            "Software that made each result, and the seed of its random numbers.",
            ("result", "Evenlight", "revision", "seed", "packages"),
            tuple(software),
        ),
        Table(
            "What each result was made from, by its SHA-256.", ("result", "input", "SHA-256"), tuple(inputs)
        ),
    )
    return Section("Where it comes from", (), tables[: 2 if inputs else 1])


def files_section(files: Mapping[str, str]) -> Section:
    """Return the files that were written, by name, with what they hold."""
    return Section(
        "Files", (), (Table("Files beside this report.", ("file", "holds"), tuple(files.items())),)
    )
