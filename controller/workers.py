"""Work that is per surface or per program and pure, spread over processes or computers.

    with Workers(count) as workers:
        for answer in workers.each(judged, surfaces, cost_s=1.0): ...

Answers come in the order of the questions and are the same to the last bit, whoever gives them: every
worker has one thread of numpy's libraries, as the command line has. (On a cluster that holds for computers
of one kind: other processors have other vector units, and may round otherwise in the last place.) A worker
that dies is replaced, and what it had not answered is asked again.

What n workers take on n cores, for a work of W seconds in m equal questions, a share q of it that stays
with the one who asks (it reads, plans, sums up), and S seconds in which a worker starts:

    T(n) = q W + S + ceil(m / n) (1 - q) W / m        T(1) = W

A folder of programs has q below 1 %; one program of surfaces as the paper places them some 60 %, for their
path is planned in a row; one whose cutters are placed (P2 to P4) 15 to 25 %.
"""

from __future__ import annotations

import contextlib
import ctypes
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
from controller.messages import said, text

if TYPE_CHECKING:  # imported where there are workers: most of the work is done here
    from concurrent.futures import Future, ProcessPoolExecutor

T = TypeVar("T")
R = TypeVar("R")

MIN_WORK_S = 2.0  # of work: less is done sooner than workers are started
MAX_LOST = 3  # workers that die one after the other with nothing answered between
AHEAD = 4  # questions that are out for every worker
CONNECT_TIMEOUT_S = 10.0  # a scheduler has to answer its first call
_PR_SET_PDEATHSIG = 1


class WorkersLost(Exception):
    """Workers die as soon as they begin, or there are none: ``said`` in full."""

    def __init__(self, key: str, **values: object) -> None:
        self.said = said(f"workers.{key}", **values)
        super().__init__(text(self.said))


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
        self.count = count or cores()
        self._asked = count > 0
        self._pool: ProcessPoolExecutor | None = None
        self._cluster = _connected(cluster) if cluster else None
        if self._cluster is not None:
            self.count = len(self._cluster.scheduler_info()["workers"])

    def __enter__(self) -> Workers:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        if self._cluster is not None:
            self._cluster.close()
        self._end_pool()

    def each(self, function: Callable[[T], R], items: Sequence[T], cost_s: float) -> Iterator[R]:
        """The answers of ``function`` in the order of ``items``; what it raises is raised here."""
        if self._cluster is not None:
            return self._on_cluster(function, items)
        if self.count < 2 or len(items) < 2 or (not self._asked and len(items) * cost_s < MIN_WORK_S):
            return here(function, items)
        return self._in_pool(function, items)

    def _in_pool(self, function: Callable[[T], R], items: Sequence[T]) -> Iterator[R]:
        with tempfile.NamedTemporaryFile(prefix="directrix-") as file:
            pickle.dump(function, file)
            file.flush()
            yield from self._asked_in_order(partial(self._submit, partial(_of_file, file.name)), items)

    def _submit(self, function: Callable[[Any], Any], item: Any) -> Future[Any]:
        if self._pool is None:
            from concurrent.futures import ProcessPoolExecutor
            from multiprocessing import get_context

            # Fresh interpreters and no forks: these would have our locks, and threads that are not there.
            self._pool = ProcessPoolExecutor(self.count, get_context("spawn"), _begin, (os.getpid(),))
        return self._pool.submit(function, item)

    def _end_pool(self) -> None:
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)
            self._pool = None

    def _on_cluster(self, function: Callable[[T], R], items: Sequence[T]) -> Iterator[R]:
        from distributed import KilledWorker

        # As bytes: the cluster need not know how to compare, hash or measure our values.
        client: Any = self._cluster
        known = client.scatter(pickle.dumps(function), broadcast=True)

        def submit(item: T) -> Any:
            return client.submit(_answer, pickle.dumps(item), known, pure=False)

        try:
            yield from map(pickle.loads, self._asked_in_order(submit, items))
        except KilledWorker as error:
            raise WorkersLost("killed", why=error) from error

    def _asked_in_order(self, submit: Callable[[T], Any], items: Sequence[T]) -> Iterator[Any]:
        from concurrent.futures.process import BrokenProcessPool

        out: list[tuple[T, Any]] = []  # questions, and futures of their answers; None: not asked yet
        lost, rest = 0, iter(items)
        while True:
            out += [(item, None) for item in islice(rest, AHEAD * self.count - len(out))]
            if not out:
                return
            try:
                for k, (item, future) in enumerate(out):
                    if future is None:
                        out[k] = item, submit(item)
                answer = out[0][1].result()
            except BrokenProcessPool:
                lost += 1
                if lost > MAX_LOST:
                    raise WorkersLost("lost", count=lost) from None
                self._end_pool()
                out = [(item, future if _has_answer(future) else None) for item, future in out]
                continue
            lost = 0
            del out[0]
            yield answer


def _has_answer(future: Future[Any] | None) -> bool:
    """That had come before the pool broke."""
    return future is not None and future.done() and not future.cancelled() and future.exception() is None


def _connected(address: str) -> Any:
    """The client of a Dask scheduler."""
    try:
        from distributed import Client
    except ImportError:
        raise WorkersLost("no_dask") from None
    try:
        client = Client(address, timeout=CONNECT_TIMEOUT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise WorkersLost("no_scheduler", address=address, why=str(error).splitlines()[0]) from error
    if not client.scheduler_info()["workers"]:
        client.close()
        raise WorkersLost("no_workers", address=address)
    return client


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
