"""Work on several processes or computers, by Dask: what `--cluster` names, and tasks for its workers.

Queues, retries and the movement of data are Dask's. A task is a function
of a module and its arguments. What it returns depends on these alone, so that neither the number of workers
nor their order changes a result. Workers must have this software: each task looks, before it runs.
"""

from __future__ import annotations

import hashlib
import importlib
import logging
import os
import platform
import signal
import socket
import sys
import uuid
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any
from urllib.parse import urlsplit

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.storage.text_files import read_toml
from evenlight.method.choices import AnalysisEffort
from evenlight.option_panels import computation, words_and_files

if TYPE_CHECKING:
    from distributed import Client, Future

LOCAL = "local"
CLUSTERS = "clusters.toml"
WAIT = 60.0  # [s] for the first worker of a scheduler
LOST = "30s"  # after which a process that does not come back is replaced
PATIENCE = 5.0  # [s] between looks for lost processes
RETRIES = 2  # of a task whose worker died
ASK_EVERY = 64  # tasks, between two questions of how many run at the same time
AHEAD = 2  # tasks under way for each thread of a worker: one runs, one waits
SOURCES = (".py", ".glsl", ".html", ".css", ".js")  # what decides how results look
REMEDY = "install the same versions on all workers"
GONE = "the scheduler of the workers has gone; start it, and run this again: what is done stays done"
HELP = (
    "Where to compute, with Dask: local (a process for each core) or local:N, the address of a scheduler "
    "(tcp://HOST:PORT), or a name from your clusters.toml (docs/scale.md)."
)
cluster_option = computation(
    "--cluster", metavar="NAME|ADDRESS", help=HELP, autocompletion=words_and_files(LOCAL)
)
ClusterOption = Annotated[str | None, cluster_option]


class SchedulerLostError(InputError):
    """The scheduler has gone, and with it all tasks."""


@cache
def software() -> dict[str, str]:
    """Return what results depend on: versions, and the SHA-256 of Evenlight's source."""
    made = provenance_now()
    return {
        "Evenlight": made.software_version,
        "the source of Evenlight": source_sha256()[:12],
        "Python": ".".join(platform.python_version_tuple()[:2]),
        **made.versions,
    }


@cache
def source_sha256() -> str:
    """Return the SHA-256 of the source of all of Evenlight, wherever it is installed."""
    package, digest = Path(__file__).parent, hashlib.sha256()
    found = {
        (Path(folder) / name).relative_to(package).as_posix(): Path(folder) / name
        for folder, _, names in os.walk(package, followlinks=True)
        for name in names
        if name.endswith(SOURCES)
    }
    for name in sorted(found):
        digest.update(f"{name}\0".encode() + hashlib.sha256(found[name].read_bytes()).digest())
    return digest.hexdigest()


def difference(here: Mapping[str, str], there: Mapping[str, str]) -> str:
    """Return what a worker has another version of, in words; nothing if all are the same.

    >>> difference({"numpy": "2.3.1", "scipy": "1.15.0"}, {"numpy": "2.2.0", "scipy": "1.15.0"})
    'numpy 2.2.0 (here 2.3.1)'
    """
    others = (f"{name} {there.get(name, 'missing')} (here {own})" for name, own in here.items())
    return ", ".join(words for words, name in zip(others, here, strict=True) if there.get(name) != here[name])


def _checked(expected: Mapping[str, str], function: Callable[..., Any], *given: Any) -> Any:
    """Return what a function returns, on a worker that has the software of who asks."""
    if differs := difference(expected, software()):
        raise InputError(f"a worker on {platform.node()} has {differs}; {REMEDY}")
    return function(*given)


@dataclass(frozen=True, slots=True)
class Workers:
    """The workers of a cluster."""

    client: Client  # the connection to their scheduler
    expected: dict[str, str] = field(default_factory=software)  # what each must have
    wanted: int = 0  # processes of this computer that there are to be; 0 of another cluster

    def places(self) -> int:
        """Return how many tasks run at the same time, at least 1.

        Raises
        ------
        SchedulerLostError
            If the scheduler has gone.
        """
        with _asking_the_scheduler():
            threads: dict[str, int] = self.client.nthreads()
        return max(1, sum(threads.values()))

    def submit(self, function: Callable[..., Any], *given: Any) -> Future:
        """Return the future result of a function of a module; futures among its arguments are awaited."""
        name = getattr(getattr(function, "func", function), "__name__", "task").strip("_")
        return self.client.submit(
            _checked, self.expected, function, *given, pure=False, key=f"{name}-{uuid.uuid4().hex}"
        )

    def mapped(self, function: Callable[..., Any], *columns: Iterable[Any]) -> Iterator[Any]:
        """Yield what a function returns for each row of some columns, in order, as `map` does.

        Few results are held at a time: no more tasks are under way than keep the workers busy.

        Raises
        ------
        InputError
            If the workers that did a task died, or those of the scheduler have gone.
        """
        under_way: deque[Future] = deque()
        try:
            for number, row in enumerate(zip(*columns, strict=True)):
                if number % ASK_EVERY == 0:
                    most = AHEAD * self.places()
                if len(under_way) >= most:
                    yield self.result(under_way.popleft())
                under_way.append(self.submit(function, *row))
            while under_way:
                yield self.result(under_way.popleft())
        finally:
            self.client.cancel(list(under_way))

    def done_of(self, futures: Collection[Future], seconds: float) -> Collection[Future]:
        """Return which of some tasks are done, after some time at most; before it, where one is done.

        Raises
        ------
        SchedulerLostError
            If the scheduler has gone.
        """
        from concurrent.futures import CancelledError

        from distributed import TimeoutError as NothingYet
        from distributed import wait

        cluster = self.client.cluster
        if self.wanted and len(cluster.workers) < self.wanted:
            cluster.scale(self.wanted)  # where even what starts processes again has given up
        try:
            done: Collection[Future] = wait(list(futures), seconds, "FIRST_COMPLETED").done
        except NothingYet:
            return ()
        except CancelledError:
            raise SchedulerLostError(GONE) from None
        return done

    def result(self, future: Future) -> Any:
        """Return the result of a task, when it is there; errors as of `result_of`."""
        while not self.done_of([future], PATIENCE):
            pass
        return result_of(future)


@contextmanager
def _asking_the_scheduler() -> Iterator[None]:
    """Raise `SchedulerLostError` where a question of Dask's client finds the line closed, or nobody there."""
    try:
        yield
    except OSError:  # CommClosedError is one
        raise SchedulerLostError(GONE) from None


def result_of(future: Future) -> Any:
    """Return the result of a task that is done.

    Raises
    ------
    InputError
        If the workers that did it died.
    SchedulerLostError
        If the scheduler has gone.
    """
    from concurrent.futures import CancelledError

    from distributed import KilledWorker
    from distributed.comm.core import CommClosedError

    try:
        return future.result()
    except KilledWorker:
        raise InputError(
            "the worker that did it died (killed, or out of memory), and so did those that tried again: "
            "give workers more memory"
        ) from None
    except (CancelledError, CommClosedError):
        raise SchedulerLostError(GONE) from None


@contextmanager
def opened_cluster(name: str, quiet: bool) -> Iterator[Workers]:
    """Yield the workers of a cluster, which are let go at the end.

    Parameters
    ----------
    name : str
        What `--cluster` says.
    quiet : bool
        Whether not to say how many workers there are, and where the dashboard of a cluster elsewhere is.

    Raises
    ------
    InputError
        If Dask is not installed, there is no such cluster, or its workers have other software.
    """
    try:
        import cryptography  # noqa: F401 - a local cluster's certificate is made with it
        import distributed
    except ImportError:
        raise InputError(
            "--cluster needs Dask, which is not installed: pip install 'evenlight[cluster]'"
        ) from None
    with ExitStack() as stack:
        client = stack.enter_context(_connected(name, distributed, stack))
        stack.enter_context(client.as_current())
        workers = Workers(client, wanted=len(client.cluster.workers) if _is_local(name) else 0)
        with _asking_the_scheduler():
            _require_same_software(workers, name)
            count = len(client.nthreads())
        if not quiet:
            noun = "worker" if count == 1 else "workers"
            shown = "" if _is_local(name) else f"; Dask's dashboard: {client.dashboard_link}"
            print(f"evenlight: {count} {noun}{shown}", file=sys.stderr)
        yield workers


@contextmanager
def opened_map(cluster: str | None, quiet: bool) -> Iterator[Callable[..., Iterable[Any]]]:
    """Yield the `map` of a cluster's workers; where none is named, Python's."""
    if cluster is None:
        yield map
        return
    with opened_cluster(cluster, quiet) as workers:
        yield workers.mapped


def _connected(name: str, distributed: Any, stack: ExitStack) -> Client:
    import dask

    kept: dict[str, Any] = {
        "distributed.scheduler.allowed-failures": RETRIES,
        "distributed.deploy.lost-worker-timeout": LOST,
        "distributed.worker.profile.enabled": False,  # its samples of an hour take more memory than the work
    }
    if _is_local(name):  # what other users of this computer could ask
        kept |= {"distributed.scheduler.http.routes": [], "distributed.worker.http.routes": []}
    stack.enter_context(dask.config.set(kept))
    for logger in list(logging.root.manager.loggerDict):
        if logger.partition(".")[0] == "distributed":
            logging.getLogger(logger).setLevel(logging.CRITICAL)  # what fails is told as a result
    if "://" in name:
        try:
            _require_answer(name, distributed)
            return distributed.Client(name, timeout=WAIT, set_as_default=False)
        except (OSError, ValueError, TypeError, RuntimeError) as error:  # the last two: TLS on one side alone
            raise InputError(
                f"--cluster {name}: no scheduler answers there ({error}); start one with `dask scheduler`, "
                "and workers with `dask worker ADDRESS`; tls:// needs certificates (docs/scale.md)"
            ) from None
    cluster = stack.enter_context(_local(name, distributed) if _is_local(name) else _named(name, distributed))
    return distributed.Client(cluster, set_as_default=False)


def _require_answer(address: str, distributed: Any) -> None:
    """Raise an error if no Dask listens at an address; its client would try for long, and never let go."""
    import asyncio  # slow to import, and no command needs it to show its help

    parts = urlsplit(address)
    if parts.hostname is None or parts.port is None:
        raise ValueError("expected tcp://HOST:PORT")
    socket.create_connection((parts.hostname, parts.port), timeout=10).close()

    async def connect() -> None:
        own = distributed.Security().get_connection_args("client")
        (await distributed.comm.connect(address, timeout=10, **own)).abort()

    asyncio.run(connect())


def _is_local(name: str) -> bool:
    return name.partition(":")[0] == LOCAL


def _local(name: str, distributed: Any) -> Any:
    """Return a process for each core of this computer, or so many; memory is shared out among them.

    They know each other by a certificate that is made for them: any user of the computer finds their ports.
    """
    _, colon, words = name.partition(":")
    if colon and not (words.isdecimal() and 1 <= int(words) <= 1024):
        raise InputError(
            f"--cluster {name}: expected local, or local:N with a number of workers from 1 to 1024"
        )
    return distributed.LocalCluster(
        n_workers=int(words) if colon else AnalysisEffort(jobs=0).threads,
        threads_per_worker=1,
        host="127.0.0.1",
        security=distributed.Security.temporary(),
        dashboard_address="127.0.0.1:0",
        scheduler_kwargs={"dashboard": False},
        silence_logs=logging.CRITICAL,
        preload=[__name__],
    )


def dask_setup(worker: object) -> None:
    """Leave Ctrl-C, which a terminal sends to all, to the command; Dask calls this in its processes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _named(name: str, distributed: Any) -> Any:
    """Return the cluster that a table of `clusters.toml` describes: a class of another package, with options.

    The file is the user's own, or is named: one that lies about in a folder of somebody else is not read.
    """
    config = Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "evenlight"
    named, _, table_name = name.rpartition(":")
    file, where = Path(named) if named else config / CLUSTERS, f"--cluster {name}"
    if not file.is_file():
        raise InputError(
            f"{where}: expected local, tcp://HOST:PORT, a name from {config / CLUSTERS}, which is not there, "
            "or FILE.toml:NAME"
        )
    tables = read_toml(file, "tables of clusters")
    table = tables.get(table_name)
    if not isinstance(table, dict):
        raise InputError(f"{where}: {file} describes {', '.join(tables) or 'none'}")
    unknown = set(table) - {"class", "workers", "options"}
    module, dot, kind = str(table.get("class", "")).rpartition(".")
    if unknown or not dot or not isinstance(table.get("options", {}), dict):
        raise InputError(
            f'{file}: [{table_name}] needs class = "package.Class"; it may have workers = N and options'
        )
    try:
        found = getattr(importlib.import_module(module), kind)
        if not (isinstance(found, type) and issubclass(found, distributed.deploy.Cluster)):
            raise TypeError(f"{module}.{kind} is no class of Dask's clusters")
        cluster = found(**table.get("options", {}))
        if "workers" in table:
            cluster.scale(table["workers"])
    except Exception as error:  # another package's: whatever it says of its options
        raise InputError(f"{file}: [{table_name}] gave {type(error).__name__}: {error}") from error
    return cluster


def _require_same_software(workers: Workers, name: str) -> None:
    """Raise `InputError` if there is no worker, or one has other software than this process."""
    from distributed import TimeoutError as TooLate

    client = workers.client
    try:
        client.wait_for_workers(1, timeout=WAIT)
    except TooLate:
        raise InputError(
            f"--cluster {name}: no worker is there after {WAIT:.0f} s; start some with `dask worker ADDRESS`"
        ) from None
    found = client.run(software, on_error="return")
    for address, there in found.items():
        if isinstance(there, OSError):  # it died meanwhile; others look before each task
            continue
        if isinstance(there, Exception):
            raise InputError(
                f"the worker {address} has no Evenlight, or another one ({type(there).__name__}: {there}); "
                f"{REMEDY}"
            )
        if differs := difference(workers.expected, there):
            raise InputError(f"the worker {address} has {differs}; {REMEDY}")
