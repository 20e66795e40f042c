"""What holds for every test: nothing is written into the home of the user who runs them.

And for those marked ``live``: a computer that was not there fails none of them, see absent_computer.py.
"""

from __future__ import annotations

import gc
import os
import random
from collections.abc import Generator, Iterator, Sequence
from pathlib import Path
from typing import Any

import hypothesis
import pytest
from support.suite import absent_computer, seed

MAX_OPEN = 500  # files; select, which the simulated bus waits with, takes 1024

# The workers of xdist must choose the same.
os.environ["DIRECTRIX_TEST_SEED"] = str(seed.SEED)

# How long an example takes is a matter of what else the computer does.
hypothesis.settings.register_profile(
    "any computer", deadline=None, suppress_health_check=[hypothesis.HealthCheck.too_slow]
)
hypothesis.settings.load_profile("any computer")


@pytest.fixture(autouse=True)
def own_state_folder(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Stored checks of one test are not found by another."""
    folder = tmp_path_factory.mktemp("state")
    monkeypatch.setenv("XDG_STATE_HOME", str(folder))
    return folder


@pytest.fixture(autouse=True)
def own_collector() -> Iterator[None]:
    """Dead objects wait for the collector, with their open files; commands let them wait for longer."""
    before = gc.get_threshold()
    yield
    gc.set_threshold(*before)
    gc.unfreeze()
    if len(os.listdir("/proc/self/fd")) > MAX_OPEN:
        gc.collect()


def pytest_addoption(parser: pytest.Parser) -> None:
    text = "keep every N-th case of each parametrized test, others each time (DIRECTRIX_TEST_SEED)"
    parser.addoption("--share", type=int, default=1, metavar="N", help=text)


def pytest_report_header(config: pytest.Config) -> str:
    return f"DIRECTRIX_TEST_SEED={seed.SEED}, one in {config.getoption('share')} of the cases"


# A worker of xdist that takes more than 5 s to end is sent SIGINT, so what is left is collected before.
@pytest.hookimpl(trylast=True)
def pytest_sessionfinish() -> None:
    gc.collect()
    gc.freeze()


# After the marks have been looked at.
@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
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
    item.stash[absent_computer.BEGAN] = absent_computer.times()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, Any, pytest.TestReport]:
    report: pytest.TestReport = yield
    return absent_computer.judged(report, item) if item.get_closest_marker("live") else report
