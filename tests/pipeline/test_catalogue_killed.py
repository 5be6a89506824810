"""Nothing is lost, done twice or half-written when workers, the client or the scheduler die."""

import os
import random
import signal
import threading
import time
from types import SimpleNamespace

import pytest
from catalogues import cluster_here, written_at
from distributed.comm.core import CommClosedError
from killed_workers import Killings, check, killable_cluster, many_clips
from warm_evenlight import Run

from evenlight.cluster import SchedulerLostError, Workers

CLIPS, KILLS = 6, 2  # `python tests/companions/killed_workers.py 40 20` for more


@pytest.fixture(scope="module")
def cluster():
    """Not the command's own; the last test here closes it."""
    with killable_cluster(1) as started:
        yield started


def test_every_video_is_done_or_listed_when_workers_are_killed(command, tmp_path):
    films, out = many_clips(tmp_path / "films", CLIPS), tmp_path / "out"
    names = [f"{k:02d}" for k in range(CLIPS)]
    words = ["catalogue", films, "--budget", 0.5, "--out", out, "--no-player", "--quiet"]
    killings = Killings(KILLS, random.Random(3))
    with killings.going_on():
        ended = command(*words)
    assert killings.done == KILLS
    failed = check(out, names)
    assert ended.code == bool(failed)
    before = written_at(out)
    with cluster_here(1) as address:
        assert command(*words, "--cluster", address).code == 0
    assert check(out, names) == []
    after = written_at(out)
    assert {name: after[name] for name in before if name not in failed} == {
        name: when for name, when in before.items() if name not in failed
    }


def test_a_catalogue_whose_client_was_killed_goes_on(command, cluster, tmp_path):
    films, out = many_clips(tmp_path / "films", 6), tmp_path / "out"
    words = ["catalogue", films, "--budget", 0.5, "--out", out, "--no-player", "--quiet"]
    run = Run([str(word) for word in [*words, "--cluster", cluster.scheduler_address]], dict(os.environ))
    until = time.monotonic() + 200
    while len(written_at(out)) < 2 and time.monotonic() < until:
        time.sleep(0.02)
    run.send_signal(signal.SIGKILL)
    run.communicate(20)
    time.sleep(2)  # what was under way at the workers may end
    before = written_at(out)
    assert len(before) >= 2
    assert not (out / "catalogue.csv").exists()
    assert command(*words, "--cluster", cluster.scheduler_address).code == 0
    assert check(out, [f"{k:02d}" for k in range(6)]) == []
    assert {name: when for name, when in written_at(out).items() if name in before} == before
    assert not list(out.glob(".*"))


@pytest.mark.parametrize("closed", [CommClosedError("in ConnectionPool.ncores"), OSError("Timed out trying")])
def test_a_scheduler_that_goes_while_it_is_asked_for_its_workers_is_told_so(closed):
    def nthreads() -> None:
        raise closed

    with pytest.raises(SchedulerLostError, match="the scheduler of the workers has gone"):
        Workers(SimpleNamespace(nthreads=nthreads), expected={}).places()


def test_a_scheduler_that_goes_is_told_in_one_line(command, cluster, tmp_path):
    films, out = many_clips(tmp_path / "films", 6), tmp_path / "out"

    def close_after_the_first() -> None:
        until = time.monotonic() + 200
        while not written_at(out) and time.monotonic() < until:
            time.sleep(0.02)
        cluster.close()

    closer = threading.Thread(target=close_after_the_first)
    closer.start()
    words = ["catalogue", films, "--budget", 0.5, "--out", out, "--no-player", "--quiet"]
    ended = command(*words, "--cluster", cluster.scheduler_address)
    closer.join()
    assert ended.code == 2
    assert "the scheduler of the workers has gone" in ended.err
    assert ended.err.count("\n") == 1
    assert not (out / "catalogue.csv").exists()
