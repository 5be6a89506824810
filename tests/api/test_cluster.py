"""What `--cluster` may name, and what is said of clusters that cannot be used."""

import asyncio
import itertools
import math
import sys
import urllib.error
import urllib.request
from pathlib import Path

import distributed.comm
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
        ("night", "expected local, tcp://HOST:PORT, a name from "),
        ("lost.toml:night", "which is not there, or FILE.toml:NAME"),
    ],
)
def test_a_cluster_that_is_none_is_refused_in_one_line(name, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    with pytest.raises(InputError) as refused:
        use(name)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


async def asked(port, stranger):
    """What a process of Dask says of itself to one who has another certificate, or none."""
    given = {"protocol": "tls", **stranger.get_connection_args("client")} if stranger else {"protocol": "tcp"}
    line = await distributed.comm.connect(f"{given.pop('protocol')}://127.0.0.1:{port}", timeout=20, **given)
    try:
        await line.write({"op": "identity", "reply": True})
        return await line.read()
    finally:
        line.abort()


def test_no_other_user_of_the_computer_gets_an_answer(capsys):
    with cluster.opened_cluster("local:1", quiet=False) as workers:
        held = workers.client.cluster
        (there,) = workers.client.run(
            lambda dask_worker: [dask_worker.port, dask_worker.http_server.port]
        ).values()
        nannies = [nanny.port for nanny in held.workers.values()]
        assert asyncio.run(asked(held.scheduler.port, held.security))["type"] == "Scheduler"
        for port, stranger in itertools.product(
            [held.scheduler.port, there[0], *nannies], [None, distributed.Security.temporary()]
        ):
            with pytest.raises(OSError, match=r"reset|closed|certificate"):
                asyncio.run(asked(port, stranger))
        for port, page in itertools.product(
            [held.scheduler.http_server.port, there[1]],
            ["status", "info/main/workers.html", "json/identity.json", "metrics", "health", "sysmon"],
        ):
            with pytest.raises(urllib.error.HTTPError, match="404"):
                urllib.request.urlopen(f"http://127.0.0.1:{port}/{page}", timeout=20)
    assert capsys.readouterr().err == "evenlight: 1 worker\n"


def test_tls_without_a_certificate_is_refused_in_one_line(address):
    with pytest.raises(InputError, match=r"no scheduler answers.*needs certificates"):
        use(address.replace("tcp", "tls"))


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
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    own = tmp_path / "config/evenlight/clusters.toml"
    own.parent.mkdir(parents=True)
    Path("clusters.toml").write_text(
        '[night]\nclass = "subprocess.Popen"\n[night.options]\nargs = ["touch", "it-ran"]\n'
    )
    for name, words in {"night": "which is not there", "./clusters.toml:night": "no class of Dask's"}.items():
        with pytest.raises(InputError, match=words):
            use(name)
    assert not Path("it-ran").exists()
    own.write_text(
        '[night]\nclass = "distributed.LocalCluster"\nworkers = 1\n'
        '[night.options]\nn_workers = 0\nprocesses = false\nprotocol = "tcp"\nhost = "127.0.0.1"\n'
        'dashboard_address = "127.0.0.1:0"\n'
        '[wrong]\nclass = "distributed.NoCluster"\n[bad]\nkind = "x"\n'
    )
    assert use("night") == use("config/evenlight/clusters.toml:night") == [1, 1, 2, 6, 24]
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
