"""A catalogue whose workers are killed at random while it is made.

By hand, as many as the issue of this feature asked for: python tests/companions/killed_workers.py 40 20
"""

from __future__ import annotations

import os
import random
import shutil
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

from catalogues import clip
from distributed import LocalCluster

from evenlight import cluster
from evenlight.analysis.catalogue.catalogue_results import RESULT
from evenlight.data_schema.storage.result_folders import SUMS
from evenlight.data_schema.storage.tables import read_rows
from evenlight.data_schema.storage.text_files import read_json_record
from evenlight.data_schema.tracks.brightness_track import read_track
from evenlight.data_schema.tracks.catalogue import CatalogueResult, CatalogueRow
from evenlight.data_schema.tracks.loss_curves import read_loss_curves


@dataclass
class Killings:
    """Workers of the command's own cluster, killed at random moments until enough have been."""

    wanted: int
    chance: random.Random
    done: int = 0

    @contextmanager
    def going_on(self) -> Iterator[None]:
        over, started, usual = threading.Event(), [], cluster._local

        def noted(*given: Any) -> Any:
            started.append(usual(*given))
            return started[-1]

        def kill() -> None:
            while self.done < self.wanted and not over.wait(self.chance.uniform(0.2, 1.5)):
                nannies = [nanny for one in started for nanny in list(one.workers.values())]
                pids = [nanny.process.pid for nanny in nannies if nanny.process is not None]
                if pid := self.chance.choice([*pids, None]):
                    with suppress(ProcessLookupError):
                        os.kill(pid, signal.SIGKILL)
                        self.done += 1

        killer = threading.Thread(target=kill)
        killer.start()
        try:
            with mock.patch.object(cluster, "_local", noted):
                yield
        finally:
            over.set()
            killer.join()


@contextmanager
def killable_cluster(workers: int = 2) -> Iterator[LocalCluster]:
    """A cluster of processes that is not the command's own."""
    with LocalCluster(
        n_workers=workers, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0",
        silence_logs=50,
    ) as started:  # fmt: skip
        yield started


def many_clips(folder: Path, count: int) -> Path:
    """A folder of so many short films, four of them different."""
    folder.mkdir()
    for k in range(count):
        if k < 4:
            clip(folder / f"{k:02d}.mkv", k, 20)
        else:
            shutil.copy(folder / f"{k % 4:02d}.mkv", folder / f"{k:02d}.mkv")
    return folder


def check(out: Path, names: list[str]) -> list[str]:
    """Every video is done or listed, none twice, none half-written; return those that failed."""
    rows = read_rows(CatalogueRow, out / "catalogue.csv")
    assert [row.name for row in rows] == names
    failed = [row.name for row in rows if row.error]
    assert all("died" in row.error for row in rows if row.error), rows
    there = sorted(path.name for path in out.iterdir() if path.is_dir() and not path.name.startswith("."))
    assert set(names) - set(failed) <= set(there) <= set(names)
    for name in there:  # also of one whose worker died after the last step
        result = read_json_record(CatalogueResult, out / name / RESULT)
        assert sorted([*result.files, RESULT, SUMS]) == sorted(path.name for path in (out / name).iterdir())
        track = read_track(out / name / "track.csv")
        assert len(track.times) == read_loss_curves(out / name / "loss_curves.npz").n_frames == 20
    for name in there[4:]:
        twin = f"{int(name) % 4:02d}"
        if twin in there:
            assert (out / name / "track.csv").read_bytes() == (out / twin / "track.csv").read_bytes()
    return failed


def main(clips: int, kills: int) -> None:
    """Make a catalogue while workers are killed, look at it, and make what is missing."""
    with tempfile.TemporaryDirectory() as temporary:
        films, out = many_clips(Path(temporary) / "films", clips), Path(temporary) / "out"
        words = ["catalogue", str(films), "--budget", "0.5", "--out", str(out), "--no-player", "--quiet"]
        killings, names = Killings(kills, random.Random(1)), [f"{k:02d}" for k in range(clips)]
        began = time.monotonic()
        with killings.going_on():
            _command(words)
        failed = check(out, names)
        print(
            f"{killings.done} kills in {time.monotonic() - began:.0f} s: {clips} clips, {len(failed)} listed"
        )
        assert _command(words) == 0
        assert check(out, names) == []
        print("run again: all done")


def _command(words: list[str]) -> int:
    from evenlight.command import main as evenlight

    try:
        evenlight(words)
    except SystemExit as ended:
        return int(ended.code or 0)
    return 0


if __name__ == "__main__":
    os.environ["EVENLIGHT_CURVES_CACHE_MB"] = "0"
    main(int(sys.argv[1]), int(sys.argv[2]))
