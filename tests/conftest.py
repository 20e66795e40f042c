"""What holds for every test: nothing is written into the home of the user who runs them.

And for those marked ``live``: a computer that was not there fails none of them, see absent_computer.py.
"""

from __future__ import annotations

import gc
import itertools
import os
import random
import re
import sys
from collections.abc import Generator, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import hypothesis
import pytest
from support.suite import absent_computer, asked_marks, seed

from controller import one_thread

NUMBER = itertools.count()  # of folders
MAX_OPEN = 500  # files; select, which the simulated bus waits with, takes 1024

# What a command freezes goes with its process; here it would stay with all tests after it, open files too.
FREEZE = gc.freeze
gc.freeze = gc.unfreeze = lambda: None

# Nearly all that a test makes is gone without a look at it.
gc.set_threshold(20_000, 10, 10)

# Of hundreds of processes that we start, each would compile all that it imports; of workers, every test.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# As commands and their children: a second thread would wait for the core of the other worker, and be counted.
one_thread.set_default()

# The workers of xdist must choose the same.
os.environ["DIRECTRIX_TEST_SEED"] = str(seed.SEED)

# How long an example takes is a matter of what else the computer does.
hypothesis.settings.register_profile(
    "any computer", deadline=None, suppress_health_check=[hypothesis.HealthCheck.too_slow]
)
hypothesis.settings.load_profile("any computer")


@pytest.fixture
def tmp_path(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """As pytest's own, which lists all folders of the thousands of tests before to find the next number."""
    name = re.sub(r"\W", "_", request.node.name)[:25]
    return tmp_path_factory.mktemp(f"{name}{next(NUMBER)}", numbered=False)


@pytest.fixture(autouse=True)
def own_state_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Stored checks of one test are not found by another; it is there once something is kept in it."""
    folder = tmp_path_factory.getbasetemp() / f"own-state{next(NUMBER)}"
    os.environ["XDG_STATE_HOME"] = str(folder)
    return folder


@pytest.fixture(autouse=True)
def own_collector() -> Iterator[None]:
    """Dead objects wait for the collector, with their open files; commands let them wait for longer."""
    before = gc.get_threshold()
    yield
    gc.set_threshold(*before)
    if len(os.listdir("/proc/self/fd")) > MAX_OPEN:
        gc.collect()


@pytest.fixture(autouse=True, scope="module")
def what_stays_is_looked_through_once() -> Iterator[None]:
    """What outlives a module is cached for good: a look through all that 12 000 tests leave takes seconds."""
    yield
    if any(gc.get_count()[1:]):  # of a few thousand objects the next module's look takes care
        gc.collect()
        FREEZE()


def pytest_configure() -> None:
    from support.suite import shipped_once  # which loads numpy: behind ``one_thread``

    shipped_once.install()


def pytest_addoption(parser: pytest.Parser) -> None:
    text = "keep every N-th case of each parametrized test, others each time (DIRECTRIX_TEST_SEED)"
    parser.addoption("--share", type=int, default=1, metavar="N", help=text)


def pytest_report_header(config: pytest.Config) -> str:
    return f"DIRECTRIX_TEST_SEED={seed.SEED}, one in {config.getoption('share')} of the cases"


# A worker of xdist that takes more than 5 s to end is sent SIGINT, so what is left is collected before.
@pytest.hookimpl(trylast=True)
def pytest_sessionfinish() -> None:
    gc.collect()
    FREEZE()


# Tests, modules and libraries stay: thirty looks through them take a third of the time of collection.
@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, Any, Any]:
    gc.disable()
    try:
        return (yield)
    finally:
        FREEZE()  # what little of it is dead already stays, too
        gc.enable()


class Backwards(pytest.Dir):
    """A folder of every other worker: of two that begin at either end, each compiles a half of the tests."""

    def collect(self) -> Iterable[pytest.Item | pytest.Collector]:
        return reversed(list(super().collect()))


def pytest_collect_directory(path: Path, parent: pytest.Collector) -> pytest.Dir | None:
    worker = os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")
    return Backwards.from_parent(parent, path=path) if int(worker) % 2 else None


@pytest.hookimpl(tryfirst=True)
def pytest_pycollect_makeitem(
    collector: pytest.Module | pytest.Class, name: str, obj: object
) -> list[pytest.Item] | None:
    """No case of a function that is not asked for; who names one is told that it is deselected."""
    config = collector.config
    if not collector.istestfunction(obj, name) or any("::" in one for one in config.args):
        return None
    marks = [*getattr(obj, "pytestmark", ()), *collector.iter_markers()]
    return [] if asked_marks.is_out(config.getoption("markexpr"), marks) else None


# After the marks have been looked at.
@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if "PYTEST_XDIST_WORKER" in os.environ:  # each must find the same
        items.sort(key=lambda item: item.path)
    one_in = config.getoption("share")
    if one_in > 1:
        kept = _share(items, one_in)
        config.hook.pytest_deselected(items=[item for item in items if item not in kept])
        items[:] = [item for item in items if item in kept]


def _share(items: Sequence[pytest.Item], one_in: int) -> set[pytest.Item]:
    """Every so-manieth case of each test, by the seed which; of every test at least one."""
    groups: dict[tuple[str, str], list[pytest.Item]] = {}
    for item in items:
        groups.setdefault((str(item.path), getattr(item, "originalname", item.name)), []).append(item)
    kept: set[pytest.Item] = set()
    for (path, name), cases in groups.items():
        first = random.Random(f"{seed.SEED} {path.rpartition('tests')[2]} {name}").randrange(one_in)
        kept.update(cases[first % len(cases) :: one_in])
    return kept


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    if item.get_closest_marker("live"):
        item.stash[absent_computer.BEGAN] = absent_computer.times()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, Any, pytest.TestReport]:
    report: pytest.TestReport = yield
    return absent_computer.judged(report, item) if item.get_closest_marker("live") else report
