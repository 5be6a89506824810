"""Clusters in this process, small catalogues, and what their results must be."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from distributed import LocalCluster
from tracked_videos import film, smooth_planes

from evenlight.data_schema.storage.tables import read_rows
from evenlight.data_schema.tracks.catalogue import CatalogueRow

TIMES = ("solve_s", "curves_s", "bound_s")  # of summary.json: what differs from run to run
# Beside what `optimize` writes; its request names another folder, and sums are of files with times, too.
OF_CATALOGUE = ("catalogue.json", "request.toml", "SHA256SUMS")


@contextmanager
def cluster_here(workers: int = 2) -> Iterator[str]:
    """The address of a cluster whose workers are threads: they see what tests have patched."""
    with LocalCluster(
        n_workers=workers, threads_per_worker=1, processes=False, protocol="tcp", host="127.0.0.1",
        dashboard_address="127.0.0.1:0", silence_logs=50,
    ) as cluster:  # fmt: skip
        yield cluster.scheduler_address


def clip(path: Path, seed: int, count: int = 25, **more: Any) -> Path:
    """A film of moving pictures that get darker and brighter, each seed in another way."""
    planes = smooth_planes(count)
    share = 0.6 + 0.4 * np.sin(np.arange(count) * (seed + 1) / 7) ** 2
    shown = [[(p[0] * s).astype(np.uint8), *p[1:]] for p, s in zip(planes, share, strict=True)]
    return film(path, shown, **more)


def rows_of(out: Path) -> dict[str, CatalogueRow]:
    return {row.name: row for row in read_rows(CatalogueRow, out / "catalogue.csv")}


def contents(folder: Path) -> dict[str, Any]:
    """The files of a folder of results, but for times and the catalogue's own."""
    found: dict[str, Any] = {}
    for path in sorted(folder.iterdir()):
        if path.name == "summary.json":
            found[path.name] = {k: v for k, v in json.loads(path.read_text()).items() if k not in TIMES}
        elif path.name == "track.json":
            found[path.name] = {k: v for k, v in json.loads(path.read_text()).items() if k != "files"}
        elif path.name not in OF_CATALOGUE:
            found[path.name] = path.read_bytes()
    return found


def written_at(out: Path) -> dict[str, int]:
    """When each track was written [ns]: whether something was done again."""
    return {path.parent.name: path.stat().st_mtime_ns for path in out.glob("[!.]*/track.csv")}
