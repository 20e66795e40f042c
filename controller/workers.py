"""Work that is per surface or per program and pure, spread over processes or computers.

    with Workers(count) as workers:
        for answer in workers.each(judged, surfaces, cost_s=1.0): ...

Answers come in the order of the questions and are the same to the last bit, whoever gives them: every
worker has one thread of numpy's libraries, as the command line has. (On a cluster that holds for computers
of one kind: other processors have other vector units, and may round otherwise in the last place.) A worker
that dies is replaced, and what it had not answered is asked again; also where a cluster loses all of its
workers, or its scheduler, and has others soon.

What n workers take on n cores, for a work of W seconds in m equal questions, a share q of it that stays
with the one who asks (it reads, plans, sums up), and S seconds in which a worker starts:

    T(n) = q W + S + ceil(m / n) (1 - q) W / m        T(1) = W

A folder of programs has q below 1 %; one program of surfaces as the paper places them some 60 %, for their
path is planned in a row; one whose cutters are placed (P2 to P4) 15 to 25 %.
"""

from __future__ import annotations

import contextlib
import ctypes
import logging
import os
import pickle
import signal
import tempfile
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache, partial
from itertools import islice
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from controller import one_thread
from controller.messages import TextError, message

if TYPE_CHECKING:  # imported where there are workers: most of the work is done here
    from concurrent.futures import Future, ProcessPoolExecutor

T = TypeVar("T")
R = TypeVar("R")

MIN_WORK_S = 2.0  # of work: less is done sooner than workers are started
MAX_LOST = 3  # workers that die one after the other with nothing answered between
AHEAD = 4  # questions that are out for every worker
CONNECT_TIMEOUT_S = 10.0  # a scheduler has to answer its first call
WORKER_BACK_S = 30.0  # for the next worker of a cluster that has lost all of them
_PR_SET_PDEATHSIG = 1


class WorkersLost(TextError):
    """Workers die as soon as they begin, or there are none."""

    def __init__(self, key: str, **values: object) -> None:
        super().__init__(message(f"workers.{key}", **values))


class Spread(Protocol):
    """How a function is asked about each of ``items``: the answers in their order.

    ``cost_s`` is about what one of them takes.
    """

    def __call__(self, function: Callable[[T], R], items: Sequence[T], cost_s: float) -> Iterator[R]: ...


def here(function: Callable[[T], R], items: Sequence[T], cost_s: float = 0.0) -> Iterator[R]:
    """One after the other, in this process."""
    return map(function, items)


def cores() -> int:
    """That this process may use."""
    return len(os.sched_getaffinity(0))


class Workers:
    """``count`` processes of this computer, 0 for a process per core; or those of a Dask scheduler.

    Without ``count`` work of less than ``MIN_WORK_S`` is done here. Raises WorkersLost.
    """

    def __init__(self, count: int = 0, cluster: str = "") -> None:
        self._asked = count > 0
        self._cluster = _Cluster(cluster) if cluster else None
        self.count = self._cluster.count if self._cluster is not None else count or cores()
        self._pool = _Pool(self.count)

    def __enter__(self) -> Workers:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        if self._cluster is not None:
            self._cluster.close()
        self._pool.end()

    def each(self, function: Callable[[T], R], items: Sequence[T], cost_s: float) -> Iterator[R]:
        """The answers of ``function`` in the order of ``items``; what it raises is raised here."""
        if self._cluster is not None:
            asked = _OfCluster(self._cluster, function)
            return map(pickle.loads, _in_order(asked, items, self.count))
        if self.count < 2 or len(items) < 2 or (not self._asked and len(items) * cost_s < MIN_WORK_S):
            return here(function, items)
        return self._in_pool(function, items)

    def _in_pool(self, function: Callable[[T], R], items: Sequence[T]) -> Iterator[R]:
        with tempfile.NamedTemporaryFile(prefix="directrix-") as file:
            pickle.dump(function, file)
            file.flush()
            yield from _in_order(_OfPool(self._pool, file.name), items, self.count)


class _Asked(Protocol):
    """Somebody who answers questions about one function."""

    def lost(self) -> tuple[type[BaseException], ...]:
        """What an answer raises that will not come any more."""

    def submit(self, item: Any) -> Any:
        """The future of an answer."""

    def renew(self) -> None:
        """Puts others in the place of what was lost. Raises WorkersLost."""

    def has_answer(self, future: Any) -> bool:
        """One that had come before."""


def _in_order(asked: _Asked, items: Sequence[T], count: int) -> Iterator[Any]:
    """The answers in the order of ``items``: what is lost is asked again. Raises WorkersLost."""
    out: list[tuple[T, Any]] = []  # questions, and futures of their answers; None: not asked yet
    lost, rest = 0, iter(items)
    while True:
        out += [(item, None) for item in islice(rest, AHEAD * count - len(out))]
        if not out:
            return
        try:
            for k, (item, future) in enumerate(out):
                if future is None:
                    out[k] = item, asked.submit(item)
            answer = out[0][1].result()
        except asked.lost():
            lost += 1
            if lost > MAX_LOST:
                raise WorkersLost("lost", count=lost) from None
            asked.renew()
            out = [(item, future if asked.has_answer(future) else None) for item, future in out]
            continue
        lost = 0
        del out[0]
        yield answer


# ---- processes of this computer ----------------------------------------------------


class _Pool:
    """``count`` processes, started with the first question."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._processes: ProcessPoolExecutor | None = None

    def submit(self, function: Callable[[Any], Any], item: Any) -> Future[Any]:
        if self._processes is None:
            from concurrent.futures import ProcessPoolExecutor
            from multiprocessing import get_context

            # Fresh interpreters and no forks: these would have our locks, and threads that are not there.
            self._processes = ProcessPoolExecutor(self._count, get_context("spawn"), _begin, (os.getpid(),))
        return self._processes.submit(function, item)

    def end(self) -> None:
        if self._processes is not None:
            self._processes.shutdown(wait=True, cancel_futures=True)
            self._processes = None


class _OfPool:
    """A function that lies in a file, asked of a pool."""

    def __init__(self, pool: _Pool, file: str) -> None:
        self._pool = pool
        self._function = partial(_of_file, file)

    def lost(self) -> tuple[type[BaseException], ...]:
        from concurrent.futures.process import BrokenProcessPool

        return (BrokenProcessPool,)

    def submit(self, item: Any) -> Future[Any]:
        return self._pool.submit(self._function, item)

    def renew(self) -> None:
        self._pool.end()

    def has_answer(self, future: Future[Any] | None) -> bool:
        return future is not None and future.done() and not future.cancelled() and future.exception() is None


# ---- a cluster ---------------------------------------------------------------------


class _Cluster:
    """A Dask scheduler and its workers. Raises WorkersLost where there are none."""

    def __init__(self, address: str) -> None:
        self._address = address
        self.client = self._connected()
        if not self.count:
            self.close()
            raise WorkersLost("no_workers", address=address)

    @property
    def count(self) -> int:
        """Of workers."""
        return len(self.client.nthreads())

    def renew(self) -> None:
        """Connected anew, once there is a worker again: a nanny of Dask's takes a moment to start one."""
        self.close()
        self.client = self._connected()
        try:
            self.client.wait_for_workers(1, timeout=WORKER_BACK_S)
        except TimeoutError:
            raise WorkersLost("no_workers", address=self._address) from None

    def close(self) -> None:
        self.client.close()

    def _connected(self) -> Any:
        try:
            from distributed import Client
        except ImportError:
            raise WorkersLost("no_dask") from None
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # we tell it, without a traceback
        try:
            return Client(self._address, timeout=CONNECT_TIMEOUT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            why = str(error).splitlines()[0]
            raise WorkersLost("no_scheduler", address=self._address, why=why) from error


class _OfCluster:
    """A function that the workers of a cluster are given once, and questions about it.

    As bytes: the cluster need not know how to compare, hash or measure our values. What the workers were
    given is gone with the last of them that has it, and every question about it with it.
    """

    def __init__(self, cluster: _Cluster, function: Callable[[Any], Any]) -> None:
        self._cluster = cluster
        self._function = pickle.dumps(function)
        self._given: Any = None

    def lost(self) -> tuple[type[BaseException], ...]:
        from distributed import CancelledError
        from distributed.comm import CommClosedError

        return CancelledError, CommClosedError

    def submit(self, item: Any) -> _Answer:
        client = self._cluster.client
        if self._given is None:
            self._given = client.scatter(self._function, broadcast=True)
        return _Answer(client.submit(_answer, pickle.dumps(item), self._given, pure=False))

    def renew(self) -> None:
        self._given = None
        self._cluster.renew()

    def has_answer(self, future: _Answer | None) -> bool:
        return False  # those were of a client that is closed


class _Answer:
    """The future of a cluster's. Raises WorkersLost where its workers died of the question."""

    def __init__(self, future: Any) -> None:
        self._future = future

    def result(self) -> Any:
        from distributed import KilledWorker

        try:
            return self._future.result()
        except KilledWorker as error:
            raise WorkersLost("killed", why=error) from error


# ---- in a worker -------------------------------------------------------------------


def _of_file(name: str, item: Any) -> Any:
    """The answer of the function in a file: what its questions have in common is read once."""
    return _read(name)(item)


@lru_cache(1)
def _read(name: str) -> Callable[[Any], Any]:
    return _function(Path(name).read_bytes())


def _answer(item: bytes, known: bytes) -> bytes:
    return pickle.dumps(_function(known)(pickle.loads(item)))


@lru_cache(2)
def _function(known: bytes) -> Callable[[Any], Any]:
    found: Callable[[Any], Any] = pickle.loads(known)
    return found


def _begin(parent: int) -> None:
    """First thing in a worker: Ctrl-C is its parent's, with whom it ends."""
    one_thread.set_default()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with contextlib.suppress(OSError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:
        os._exit(1)  # it was gone before we could ask
