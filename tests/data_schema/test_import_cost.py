"""The command starts fast, because what is slow to import is imported where it is used."""

import os
import subprocess
import sys
import time

import pytest
from machine_speed import slowness

SLOW = {"numpy", "scipy", "pandas", "statsmodels", "matplotlib", "numba", "av", "jsonschema", "tomli_w"} | {
    "moderngl",
    "serial",
    "psychopy",
}


def imported_by(statement: str) -> set[str]:
    """The packages that are loaded after a statement, in a fresh interpreter."""
    program = f"import sys; {statement}; print(*sorted({{name.partition('.')[0] for name in sys.modules}}))"
    answer = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return set(answer.stdout.split())


def test_the_command_imports_nothing_slow_before_it_knows_what_to_do() -> None:
    assert imported_by("import evenlight.command").isdisjoint(SLOW)


def test_records_are_light_to_import() -> None:
    modules = (
        "tracks.brightness_track", "tracks.loss_curves", "record_kinds", "storage.text_files",
        "recordings.session", "storage.whole_files", "checking.validation",
    )  # fmt: skip
    together = ", ".join(f"evenlight.data_schema.{module}" for module in modules)
    assert imported_by(f"import {together}").isdisjoint(SLOW)


@pytest.mark.real_time
@pytest.mark.slow
def test_help_is_there_within_half_a_second() -> None:
    """The target is 0.5 s of one core, as fast as now; the fastest of three: there is other work."""
    fastest = min(_time_of_help() / max(1.0, slowness()) for _ in range(3))
    assert fastest < 0.5


def _time_of_help() -> float:
    before = os.times()
    begin = time.perf_counter()
    subprocess.run([sys.executable, "-m", "evenlight", "--help"], capture_output=True, check=True)
    after = os.times()
    used = after.children_user + after.children_system - before.children_user - before.children_system
    return min(used, time.perf_counter() - begin)
