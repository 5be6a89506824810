"""`evenlight catalogue`: the results of `optimize` for each video, once, whatever happens to single ones."""

import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from catalogues import clip, cluster_here, contents, rows_of, written_at
from loopback_server import served

from evenlight import cluster
from evenlight.analysis.catalogue import catalogue_results
from evenlight.analysis.catalogue.entries import videos_of
from evenlight.analysis.tracks.track_request import TrackRequest
from evenlight.command import main
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.tracks.loss_curves import read_loss_curves, write_loss_curves
from evenlight.method.choices import ObjectiveName

pytestmark = pytest.mark.usefixtures("blank_pictures")


@pytest.fixture(scope="module")
def workers() -> Iterator[str]:
    with cluster_here() as address:
        yield address


@pytest.fixture
def catalogue(command, workers, tmp_path):
    """Run the command into tmp_path/out, on two workers."""

    def run(source, *more, budget=0.5, out="out"):
        return command(
            "catalogue", source, "--budget", budget, "--out", tmp_path / out, "--cluster", workers, "--quiet",
            "--no-player", *more,
        )  # fmt: skip

    return run


@pytest.fixture(scope="module")
def made(workers, tmp_path_factory):
    """A folder of three films, the last of them below, and their catalogue at a budget of 0.5."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "films" / "old").mkdir(parents=True)
    for seed, name in enumerate(("a.mkv", "b.mkv", "old/c.mkv")):
        clip(folder / "films" / name, seed, 20)
    words = ["catalogue", folder / "films", "--budget", 0.5, "--out", folder / "out", "--cluster", workers]
    with pytest.raises(SystemExit) as ended:
        main([str(word) for word in [*words, "--quiet", "--no-player"]])
    assert not ended.value.code
    return folder


@pytest.fixture
def films(made, tmp_path):
    """The films, without results."""
    return Path(shutil.copytree(made / "films", tmp_path / "films"))


@pytest.fixture
def catalogued(made, films, tmp_path):
    """The films, with their results in tmp_path/out."""
    shutil.copytree(made / "out", tmp_path / "out")
    return films


def test_one_bad_video_stops_no_other(catalogue, films, tmp_path):
    (films / "broken.mp4").write_bytes(b"no video")
    (films / "empty.mkv").touch()
    ended = catalogue(films)
    assert ended.code == 1
    assert ended.err == ""
    errors = {name: row.error for name, row in rows_of(tmp_path / "out").items() if row.error}
    assert list(errors) == ["broken", "empty"]
    assert "FFmpeg finds no video in" in errors["broken"]
    assert "is empty" in errors["empty"]
    assert {name for name, row in rows_of(tmp_path / "out").items() if not row.error} == {"a", "b", "old-c"}
    assert "What failed" in (tmp_path / "out" / "report.html").read_text()


def test_a_defect_is_told_and_stops_no_other(catalogue, films, tmp_path, monkeypatch):
    usual = catalogue_results.run_optimization

    def breaks_at_b(job, folder):
        if job.source.name == "b":
            raise ZeroDivisionError("by hand\nin two lines")
        return usual(job, folder)

    monkeypatch.setattr(catalogue_results, "run_optimization", breaks_at_b)
    assert catalogue(films).code == 1
    [error] = [row.error for row in rows_of(tmp_path / "out").values() if row.error]
    assert error == f"{catalogue_results.DEFECT}: ZeroDivisionError: by hand in two lines"
    assert not (tmp_path / "out" / "b").exists()
    assert not list((tmp_path / "out").glob(".*"))


def test_run_again_it_does_only_what_is_missing_or_has_changed(catalogue, catalogued, tmp_path):
    films, out = catalogued, tmp_path / "out"
    first = written_at(out)
    os.utime(films / "a.mkv")  # touched, not changed
    assert catalogue(films).code == 0
    assert written_at(out) == first
    clip(films / "b.mkv", 7)
    (out / "old-c" / "track.csv").unlink()
    assert catalogue(films).code == 0
    second = written_at(out)
    assert second["a"] == first["a"]
    assert second["b"] > first["b"]
    assert second["old-c"] > first["old-c"]
    assert catalogue(films, "--calm", 0).code == 0
    assert all(second[name] < when for name, when in written_at(out).items())
    (out / "a" / "notes.txt").write_text("of the user")
    assert catalogue(films, "--calm", 0.1).code == 1
    assert "holds other things than a result of `evenlight catalogue`: notes.txt" in rows_of(out)["a"].error
    assert (out / "a" / "notes.txt").read_text() == "of the user"
    assert catalogue(films, "--calm", 0.1, "--force").code == 0
    assert not (out / "a" / "notes.txt").exists()


def test_other_software_makes_all_again(catalogue, catalogued, tmp_path, monkeypatch):
    films = catalogued
    first = written_at(tmp_path / "out")
    other = {**cluster.software(), "numpy": "1.0"}
    monkeypatch.setattr("evenlight.analysis.catalogue.catalogue_results.software", lambda: other)
    assert catalogue(films).code == 0
    assert all(first[name] < when for name, when in written_at(tmp_path / "out").items())


def test_another_budget_takes_the_loss_curves_that_are_there(catalogue, catalogued, tmp_path, monkeypatch):
    films = catalogued
    monkeypatch.setattr(
        "evenlight.stimuli.video.video_analysis.VideoAnalysis.curves",
        lambda *given: pytest.fail("analysed again"),
    )
    assert catalogue(films, budget=0.7).code == 0
    assert {row.budget for row in rows_of(tmp_path / "out").values()} == {0.7}


def test_a_table_says_what_is_asked_of_single_videos(catalogue, catalogued, tmp_path):
    films = catalogued
    curves = read_loss_curves(tmp_path / "out" / "a" / "loss_curves.npz")
    write_loss_curves(films / "known.npz", curves)
    (films / "two.weights.csv").write_text("start_s,end_s,weight\n0,0.5,3\n")
    table = films / "night.catalogue.csv"
    table.write_text(
        "path,name,budget,budget_unit,weights\n"
        "a.mkv,,0.7,,two.weights.csv\nknown.npz,from-curves,,,\na.mkv,again,1.2,watt,\nmissing.mkv,,,,\n"
    )
    assert catalogue(table, out="table").code == 1
    rows = rows_of(tmp_path / "table")
    assert list(rows) == ["a", "from-curves", "again", "missing"]
    assert [row.budget for row in rows.values()] == [0.7, 0.5, 1.2, None]
    assert json.loads((tmp_path / "table" / "a" / "summary.json").read_text())["weighted"]
    assert "missing.mkv" in rows["missing"].error
    for name in ("track.csv", "loss_curves.npz"):
        alone = (tmp_path / "out" / "a" / name).read_bytes()
        assert (tmp_path / "table" / "from-curves" / name).read_bytes() == alone
    assert sorted(p.name for p in (tmp_path / "table" / "from-curves").iterdir()) == [
        "SHA256SUMS",
        "catalogue.json",
        "loss_curves.npz",
        "price.png",
        "price_points.csv",
        "summary.json",
        "track.csv",
        "track.json",
        "track.png",
    ]  # fmt: skip; no request.toml: `optimize` is asked of a video


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere", "--budget", 0.5], "nowhere: no such file or folder"),
        (["{films}", "--budget", 1.5], "the budget 1.5 (factor) cannot be met"),
        (["{films}", "--budget", 0.5, "--display", "nosuch"], "nosuch"),
        (["{table}", "--budget", 0.5], "the folder of two rows"),
        (["{badname}", "--budget", 0.5], "cannot be that of a folder"),
        (["{badcolumn}", "--budget", 0.5], "unknown column 'colour'"),
        (["{badfactor}", "--budget", 0.5], "line 3: min_factor must lie in 0.001 to 0.99, got 7"),
        (["{badunit}", "--budget", 0.5], "line 2: budget_unit: expected one of 'factor', 'power', 'watt'"),
        (["{badbudget}", "--budget", 0.5], "line 2: budget must be above 0, got 0.0"),
        (["{above}", "--budget", 0.5], "line 3: the budget 7 (factor) cannot be met"),
        (["{unnamed}", "--budget", 0.5], "line 3: names no video in the column path"),
    ],
)
def test_what_is_wrong_of_all_is_refused_at_once(command, films, tmp_path, arguments, words):
    tables = {"table": "path,name\na.mkv,x\nb.mkv,x\n", "badname": "path,name\na.mkv,../x\n",
              "badcolumn": "path,colour\na.mkv,red\n",
              "badfactor": "path,min_factor\na.mkv,0.3\nb.mkv,7\n",
              "badunit": "path,budget_unit\na.mkv,lux\n", "badbudget": "path,budget\na.mkv,0\n",
              "above": "path,budget\na.mkv,0.4\nb.mkv,7\n",
              "unnamed": "path,budget\na.mkv,0.4\n,0.4\n"}  # fmt: skip
    for name, text in tables.items():
        (tmp_path / f"{name}.csv").write_text(text)
    places = {"films": films, **{name: tmp_path / f"{name}.csv" for name in tables}}
    given = [str(word).format(**places) for word in arguments]
    ended = command("catalogue", *given, "--out", tmp_path / "out", "--quiet")
    assert ended.code == 2
    assert words in ended.err
    assert ended.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_every_option_of_all_videos_is_a_column(films, tmp_path):
    """Those of earlier tables too, under the names that they had."""
    table = films / "own.csv"
    table.write_text(
        "path,calm,actuator,field_of_view_deg,objective,other_display_ok,battery_wh,power_model\n"
        "a.mkv,0.25,pixels,40,minimax,true,12,surace2025\nb.mkv,,,,,,,\n"
    )
    own, usual = (one.asked for one in videos_of(str(table), TrackRequest(budget=0.5), tmp_path / "out"))
    assert (own.calm, own.actuator, own.field_of_view) == (0.25, Actuator.PIXELS, 40.0)
    assert (own.objective, own.other_display_ok, own.battery_wh) == (ObjectiveName.MINIMAX, True, 12.0)
    assert (own.power_model, own.budget) == ("surace2025", 0.5)
    assert usual == TrackRequest(budget=0.5)


def test_films_of_one_name_get_folders_of_their_own(tmp_path):
    names = ["a.mkv", "old/a.mkv", "b.mkv", "b.mp4", "x/y-z.mkv", "x-y/z.mkv", "report.html.mkv", "A.mkv"]
    for name in names:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"of any kind")
    found = videos_of(str(tmp_path), TrackRequest(budget=0.5), tmp_path / "out")
    assert len({one.name.casefold() for one in found}) == len(names)
    named = {Path(one.video).relative_to(tmp_path).as_posix(): one.name for one in found}
    assert (named["old/a.mkv"], named["b.mkv"], named["b.mp4"]) == ("old-a", "b.mkv", "b.mp4")
    (tmp_path / "new.mkv").write_bytes(b"of any kind")  # names of the others stay
    again = videos_of(str(tmp_path), TrackRequest(budget=0.5), tmp_path / "out")
    assert {one.video: one.name for one in found}.items() <= {one.video: one.name for one in again}.items()


def test_what_lies_in_the_folder_of_results_is_no_video(films):
    (films / "tracks").mkdir()
    shutil.copy(films / "a.mkv", films / "tracks" / "dimmed.mkv")
    assert len(videos_of(str(films), TrackRequest(budget=0.5), films / "tracks")) == 3


def test_workers_in_another_folder_find_all_files(films, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.display.toml").write_text("")
    [first, *_] = videos_of("films", TrackRequest(budget=0.5, display="own.display.toml"), Path("out"))
    assert first.video == str(films / "a.mkv")
    assert first.asked.display == str(tmp_path / "own.display.toml")
    assert first.asked.rate_limit == "surace2025"


def test_a_row_that_names_another_film_is_made_again(catalogue, tmp_path):
    """Of the same size and the same time of change."""
    for seed, name in enumerate("ab"):
        clip(tmp_path / f"{name}.mkv", seed, 20)
        os.utime(tmp_path / f"{name}.mkv", (10**9, 10**9))
    size = max((tmp_path / f"{name}.mkv").stat().st_size for name in "ab")
    hashes = []
    for name in "ab":
        (tmp_path / "list.csv").write_text(f"path,name\n{name}.mkv,x\n")
        with monkeypatched_state(size):
            assert catalogue(tmp_path / "list.csv").code == 0
        hashes.append(json.loads((tmp_path / "out" / "x" / "catalogue.json").read_text())["video_sha256"])
        assert rows_of(tmp_path / "out")["x"].video.endswith(f"{name}.mkv")
    assert len(set(hashes)) == 2


@contextmanager
def monkeypatched_state(size: int) -> Iterator[None]:
    """All files have one size and one time of change."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(catalogue_results, "file_state", lambda name: f"{size} 1000000000")
        yield


def test_a_name_that_is_no_text_has_a_link_too(catalogue, tmp_path):
    name = os.fsdecode(b"bad\xff.mkv")
    clip(tmp_path / name, 0, 20)
    assert catalogue(tmp_path / name).code == 0
    assert 'href="bad%FF/track.png"' in (tmp_path / "out" / "report.html").read_text()


def test_videos_at_urls_come_out_as_from_files(catalogue, tmp_path):
    films = tmp_path / "films"
    films.mkdir()
    clip(films / "a film.mkv", 0, 20)
    assert catalogue(films, out="files").code == 0
    with served(films) as server:
        assert catalogue(f"{server.url}/*.mkv", out="urls").code == 0
    assert contents(tmp_path / "urls" / "a film") == contents(tmp_path / "files" / "a film")
