"""Simulations and benchmarks on a cluster give what they give without one, however many workers there are.

One cluster of two processes serves these tests. Four workers are threads of this one: each process imports
all there is, which takes seconds.
"""

import logging
import os
import re
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import nullcontext, suppress
from functools import cache
from pathlib import Path
from typing import Any

import made_subject
import numpy as np
import pytest
import studies
from catalogues import cluster_here
from distributed import LocalCluster
from moving_patterns import pattern

from benchmarks import run as bench_run
from evenlight import command as command_line
from evenlight.analysis import plan_command
from evenlight.analysis.dataset_findings import DatasetFindings
from evenlight.analysis.figure_style import QUICK_MARK, marked_figures
from evenlight.analysis.plans.questions import RampQuestion, SearchTruth
from evenlight.analysis.reproduction import reproduction
from evenlight.cluster import opened_cluster

PLANS = {
    "ramp": ("--participants", "2,3", "--trials", "20", "--design", "yes_no_targeted"),
    "rating": ("--participants", "6,8"),
    "comparison": ("--participants", "6,8"),
    "search": ("--participants", "8", "--locations", "2"),
}
# Times: no result; and a summary with times has another SHA-256.
LEFT_OUT = re.compile(r'"(solve|curves|bound)_s": [0-9.e-]+|"summary.json": "[0-9a-f]+"')


def files_of(folder: Path) -> dict[str, bytes]:
    """The content of every file, without the times in it."""
    return {
        path.relative_to(folder).as_posix(): LEFT_OUT.sub("", path.read_text()).encode()
        if path.suffix == ".json"
        else path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.fixture(scope="module")
def cluster() -> Iterator[LocalCluster]:
    started = LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        host="127.0.0.1",
        dashboard_address=None,
        silence_logs=logging.CRITICAL,
    )
    yield started
    with suppress(TimeoutError):  # on a busy machine a worker takes longer to end than Dask waits for it
        started.close()


@pytest.fixture(scope="module")
def small_plans() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(RampQuestion.efforts, "quick", 5)
        patch.setitem(SearchTruth.efforts, "quick", 6)
        patch.setattr(plan_command, "SLOW", ())  # processes of its own are tested elsewhere
        yield


@pytest.fixture(scope="module")
def alone(small_plans: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The plans without a cluster."""
    folder = tmp_path_factory.mktemp("alone")
    plans_into(folder)
    return folder


def plans_into(folder: Path, *options: str) -> None:
    for task, words in PLANS.items():
        out = str(folder / task)
        with pytest.raises(SystemExit) as ended:
            command_line.main(["plan", task, *words, "--quick", "--quiet", "--out", out, *options])
        assert not ended.value.code


@pytest.fixture
def study(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Run a study's script with some words, in this process, and return what it prints."""

    def told(*words: str) -> str:
        monkeypatch.setattr(sys, "argv", ["found_share_coverage.py", "3", *words])
        capsys.readouterr()
        studies.run_study("benchmarks/studies/found_share_coverage.py", sets=2000)
        return capsys.readouterr().out

    return told


def test_plans_and_studies_are_the_same_in_other_processes(
    cluster: LocalCluster, alone: Path, study: Callable[..., str], tmp_path: Path
) -> None:
    assert_same_with(2, cluster.scheduler_address, alone, study, tmp_path)


def test_plans_and_studies_do_not_depend_on_the_number_of_threads(
    alone: Path, study: Callable[..., str], tmp_path: Path
) -> None:
    with cluster_here(4) as address:
        assert_same_with(4, address, alone, study, tmp_path)


def assert_same_with(
    workers: int, address: str, alone: Path, study: Callable[..., str], folder: Path
) -> None:
    with opened_cluster(address, quiet=True) as opened:
        opened.client.wait_for_workers(workers)
        assert opened.places() == workers
    plans_into(folder, "--cluster", address)
    assert len(files_of(alone)) == 4 * len(PLANS)
    assert files_of(folder) == files_of(alone)
    assert study("--cluster", address) == study()


def test_a_reproduction_is_the_same_on_a_cluster(
    cluster: LocalCluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    analysed = cache(reproduction._analysed)  # in this process alone: once is enough

    def ramps_alone(plan: Any, folder: Path, task: str, recorded: Any) -> DatasetFindings:
        if task != "ramp":
            return DatasetFindings()
        found = analysed(plan, tmp_path, task, recorded)
        shutil.copytree(tmp_path / reproduction.CALIBRATION, folder / reproduction.CALIBRATION)
        return found

    for name, value in {
        "_analysed": ramps_alone,
        "built_in_sequence": pattern,
        "BUDGETS": {"library": 0.5},
        "EXAMPLES": {},
        "VIEWING_TASKS": ("rating",),
    }.items():
        monkeypatch.setattr(reproduction, name, value)
    plan = reproduction.ReproductionPlan(viewers=4, calibrators=3, quick=True)
    told: dict[str, list[str]] = {"here": [], "there": []}
    with marked_figures(QUICK_MARK):
        here = reproduction.run_pipeline(plan, tmp_path / "here", told["here"].append)
        with opened_cluster(cluster.scheduler_address, quiet=True) as opened:
            there = reproduction.run_pipeline(plan, tmp_path / "there", told["there"].append, opened.mapped)
    assert files_of(tmp_path / "there") == files_of(tmp_path / "here")
    assert told["there"] == told["here"]
    for one, other in zip(returned(there), returned(here), strict=True):
        np.testing.assert_array_equal(one, other)


def returned(made: reproduction.Reproduction) -> Iterator[Any]:
    """What a pipeline hands on, beside its files."""
    yield made.walk.loss
    for sequence in (*made.sequences, *made.examples):
        yield from (sequence.unconstrained, sequence.baseline_loss, np.stack(sequence.maps.emitted))
        yield from (pixels for _, pixels in sequence.samples)


def test_a_worker_that_does_not_see_the_folder_says_so(cluster: LocalCluster, tmp_path: Path) -> None:
    with opened_cluster(cluster.scheduler_address, quiet=True) as opened:
        done = opened.submit(reproduction._done, False, tmp_path / "elsewhere", dict)
        with pytest.raises(reproduction.InputError, match="a folder that all workers share"):
            opened.result(done)


def test_a_subject_of_the_benchmarks_is_measured_by_a_worker(
    cluster: LocalCluster, command: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bench_run, "subjects", lambda names: dict.fromkeys(names, made_subject.measure))
    words = ("bench", "fit", "--quick", "--out", tmp_path, "--cluster", cluster.scheduler_address)
    outcome = command(*words)
    assert outcome.code == 0, outcome.err
    (measurer,) = re.findall(r"Measured by (\d+)\.", outcome.out)
    assert int(measurer) != os.getpid()
    assert "processor: " in (tmp_path / "benchmarks.md").read_text()


def test_a_local_cluster_measures_one_subject_at_a_time(
    command: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str | None] = []
    monkeypatch.setattr(bench_run, "subjects", lambda names: dict.fromkeys(names, made_subject.measure))
    monkeypatch.setattr(bench_run, "opened_map", lambda name, quiet: asked.append(name) or nullcontext(map))
    for name in ("local", "local:2"):
        assert command("bench", "fit", "--quick", "--out", tmp_path / name[-1], "--cluster", name).code == 0
    assert asked == ["local:1", "local:2"]


@pytest.mark.parametrize("words", [("plan", "rating"), ("reproduce", "--quick"), ("bench", "fit", "--quick")])
def test_without_dask_one_line_says_how_to_get_it(
    words: tuple[str, ...], command: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    outcome = command(*words, "--out", tmp_path / "out", "--cluster", "local")
    assert outcome.code == 2
    assert outcome.err.count("\n") == 1
    assert "pip install 'evenlight[cluster]'" in outcome.err
    assert not (tmp_path / "out").exists()
