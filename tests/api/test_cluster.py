"""What `--cluster` may name, and what is said of clusters that cannot be used."""

import math
import sys

import pytest
from catalogues import cluster_here

from evenlight import cluster
from evenlight.data_schema.errors import InputError


@pytest.fixture(scope="module")
def address():
    with cluster_here(1) as found:
        yield found


def use(name: str) -> list[int]:
    with cluster.opened_map(name, quiet=True) as mapped:
        return list(mapped(math.factorial, range(5)))


def test_workers_map_in_order(address):
    assert use(address) == [1, 1, 2, 6, 24]


def test_without_a_cluster_it_is_the_plain_map():
    with cluster.opened_map(None, quiet=True) as mapped:
        assert mapped is map


def test_no_more_tasks_are_under_way_than_keep_the_workers_busy(address):
    taken = 0

    def numbers():
        nonlocal taken
        for number in range(50):
            taken += 1
            yield number

    with cluster.opened_cluster(address, quiet=True) as workers:
        results = workers.mapped(math.factorial, numbers())
        next(results)
        assert taken <= cluster.AHEAD * workers.places() + 1
        assert list(results)[-1] == math.factorial(49)


def test_the_dashboard_is_told_unless_quiet(address, capsys):
    with cluster.opened_cluster(address, quiet=False):
        pass
    assert "1 worker; Dask's dashboard: http://127.0.0.1:" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("local:0", "expected local, or local:N"),
        ("local:two", "expected local, or local:N"),
        ("tcp://127.0.0.1:9", "no scheduler answers there"),
        ("tcp://127.0.0.1", "expected tcp://HOST:PORT"),
        ("night", "expected local, tcp://HOST:PORT, or a name from clusters.toml"),
    ],
)
def test_a_cluster_that_is_none_is_refused_in_one_line(name, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    with pytest.raises(InputError) as refused:
        use(name)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_without_dask_one_line_says_how_to_get_it(monkeypatch, command, tmp_path):
    (tmp_path / "film.mkv").write_bytes(b"of any kind")
    monkeypatch.setitem(sys.modules, "distributed", None)
    ended = command("catalogue", tmp_path / "film.mkv", "--budget", 0.5, "--out", tmp_path / "out")
    assert ended.code == 2
    assert "pip install 'evenlight[cluster]'" in ended.err
    assert ended.err.count("\n") == 1


def test_a_worker_with_other_software_is_refused_in_one_line(address, monkeypatch):
    monkeypatch.setattr(cluster.Workers, "__init__", other_software(cluster.Workers.__init__))
    with pytest.raises(
        InputError, match=r"the worker tcp://\S+ has numpy \S+ \(here 1\.0\); install the same"
    ):
        use(address)


def other_software(usual):
    def made(self, client, wanted=0):
        usual(self, client, {**cluster.software(), "numpy": "1.0"}, wanted)

    return made


def test_a_worker_that_comes_later_is_looked_at_too():
    with pytest.raises(InputError, match=r"numpy \S+ \(here 1\.0\)"):
        cluster._checked({"numpy": "1.0"}, math.factorial, 3)


def test_a_name_of_clusters_toml_is_a_class_of_another_package(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "clusters.toml").write_text(
        '[night]\nclass = "distributed.LocalCluster"\nworkers = 1\n'
        '[night.options]\nn_workers = 0\nprocesses = false\nprotocol = "tcp"\nhost = "127.0.0.1"\n'
        'dashboard_address = "127.0.0.1:0"\n'
        '[wrong]\nclass = "distributed.NoCluster"\n[bad]\nkind = "x"\n'
    )
    assert use("night") == [1, 1, 2, 6, 24]
    for name, words in {
        "wrong": r"\[wrong\] gave AttributeError",
        "bad": r"\[bad\] needs class",
        "day": "describes night, wrong, bad",
    }.items():
        with pytest.raises(InputError, match=words):
            use(name)


def test_the_source_that_workers_must_have_is_that_of_this_package():
    assert cluster.difference(cluster.software(), cluster.software()) == ""
    assert len(cluster.source_sha256()) == 64
