"""`evenlight catalogue` writes what `evenlight optimize` does, byte for byte."""

import json

import pytest
from catalogues import clip, cluster_here, contents, rows_of


@pytest.fixture
def catalogue(command, tmp_path):
    """Run the command into tmp_path/out, on two workers."""
    with cluster_here() as address:

        def run(source, *more, budget=0.5, out="out"):
            words = ["--budget", budget, "--out", tmp_path / out, "--cluster", address]
            return command("catalogue", source, *words, "--quiet", "--no-player", *more)

        yield run


def test_each_video_gets_the_folder_that_optimize_writes(catalogue, command, tmp_path):
    films = tmp_path / "films"
    films.mkdir()
    for seed, name in enumerate("abc"):
        clip(films / f"{name}.mkv", seed, 20)
    assert catalogue(films).code == 0
    for path in films.rglob("*.mkv"):
        alone = tmp_path / "alone" / path.stem
        done = command("optimize", path, "--budget", 0.5, "--out", alone, "--quiet", "--no-player")
        assert done.code == 0
        assert contents(tmp_path / "out" / path.stem) == contents(alone)
    rows = rows_of(tmp_path / "out")
    assert list(rows) == ["a", "b", "c"]
    summary = json.loads((tmp_path / "out" / "a" / "summary.json").read_text())
    assert (rows["a"].frames, rows["a"].objective) == (20, summary["objective"])
    assert rows["a"].gap == pytest.approx(1 - summary["lower_bound"] / summary["objective"], rel=1e-12)
    assert not any(row.error for row in rows.values())
    page = (tmp_path / "out" / "report.html").read_text()
    assert 'href="a/track.png"' in page
    assert "All 3 videos have a track" in page
