"""What looking on costs the tick: its lateness with 20 event listeners and 100 status requests per second.

A machine as in a shop (``serve --simulate`` and ``panel``) moves slowly; turns with and
without the load alternate in one run, so both meet the same computer. The lateness of every tick
comes from the recorder. The listeners' own process runs at the lowest priority: in a shop it is
another computer.
"""

from __future__ import annotations

import asyncio
import contextlib
import multiprocessing
import os
import sys
import tempfile
import time
from collections.abc import AsyncIterator
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from websockets.asyncio.client import connect

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parents[1])]

from support.live.shop import Shop, opened  # noqa: E402
from support.suite import figures  # noqa: E402
from support.suite.figures import Figure, Report  # noqa: E402

from controller.ipc.control_socket import Client, control_path  # noqa: E402
from controller.ipc.handoff import COLUMN  # noqa: E402
from controller.ipc.packed_rows import unpacked  # noqa: E402

LISTENERS, PER_S = 20, 100
SETTLE_S = 1.0  # after a change of the load
BOUND = 1.3
PERIOD_S, NICE = 2e-3, 19
ENOUGH = 0.9  # of the load


class Heard:
    """What the load got, to see that there was one."""

    def __init__(self) -> None:
        self.events = self.answers = 0


async def listen(url: str, heard: Heard) -> None:
    async with connect(url.replace("http", "ws") + "/api/v1/events", proxy=None) as socket:
        async for _ in socket:
            heard.events += 1


async def ask(client: httpx.AsyncClient, heard: Heard) -> None:
    """So many requests a second, each when it is due, not when the last one was answered."""
    due_s, asked = time.monotonic(), set()
    while True:
        task = asyncio.create_task(client.get("/api/v1/status"))
        asked.add(task)
        task.add_done_callback(asked.discard)
        task.add_done_callback(lambda done: _count(done, heard))
        due_s += 1.0 / PER_S
        await asyncio.sleep(max(0.0, due_s - time.monotonic()))


def _count(done: asyncio.Task[httpx.Response], heard: Heard) -> None:
    if not done.cancelled() and done.exception() is None and done.result().is_success:
        heard.answers += 1


@contextlib.asynccontextmanager
async def load(url: str, heard: Heard) -> AsyncIterator[None]:
    limits = httpx.Limits(max_connections=20)
    async with httpx.AsyncClient(base_url=url, limits=limits, trust_env=False, timeout=30.0) as client:
        tasks = [asyncio.create_task(listen(url, heard)) for _ in range(LISTENERS)]
        tasks.append(asyncio.create_task(ask(client, heard)))
        try:
            yield
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)


def play(
    url: str, nice: int, on: Event, off: Event, told: multiprocessing.Queue[tuple[int, int, float]]
) -> None:
    """The process of the load: it lasts from ``on`` to ``off``."""
    os.nice(nice)

    async def turn() -> None:
        heard, began_s = Heard(), time.monotonic()
        async with load(url, heard):
            while not off.is_set():
                await asyncio.sleep(0.02)
        told.put((heard.events, heard.answers, time.monotonic() - began_s))

    while True:
        on.wait()
        on.clear()
        asyncio.run(turn())
        off.clear()


def lateness_s(door: Client, after: int) -> tuple[np.ndarray, int]:
    """Of every deadline after that tick: (seconds, how many of them sent no SYNC)."""
    now, found = door.ask("status"), []
    last = int(now["tick"]["number"])
    while after < last:
        rows = unpacked(door.ask("rows", after=after))
        found.append(rows[rows[:, COLUMN["tick"]] <= last])
        after = int(rows[-1, COLUMN["tick"]])
    rows = np.concatenate(found)
    ticks = rows[:, COLUMN["tick"]].astype(int)
    late_s = of_deadlines(ticks, rows[:, COLUMN["lateness_s"]], now["time_s"] / last)
    return late_s, len(late_s) - int(np.count_nonzero(rows[:, COLUMN["sync_sent"]]))


def of_deadlines(ticks: np.ndarray, late_s: np.ndarray, period_s: float) -> np.ndarray:
    """A tick that missed deadlines is late for each of them: by its own lateness and whole periods."""
    counts = np.diff(ticks, prepend=ticks[0] - 1)
    before = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.repeat(late_s, counts) + before * period_s


def tick(shop: Shop) -> int:
    return int(shop.status()["tick"]["number"])


def measure(rounds: int, seconds: float, period_s: float, nice: int) -> dict[str, object]:
    late: dict[str, list[np.ndarray]] = {"quiet": [], "looked at": []}
    skips, events, answers, lasted_s = dict.fromkeys(late, 0), 0, 0, 0.0
    context = multiprocessing.get_context("spawn")
    on, off, told = context.Event(), context.Event(), context.Queue()
    with tempfile.TemporaryDirectory() as folder, opened(Path(folder), period_s) as shop:
        shop.ready()
        shop.move_slowly()
        door = Client(control_path(shop.runtime))
        child = context.Process(target=play, args=(shop.url, nice, on, off, told), daemon=True)
        child.start()
        for number in range(2 * rounds):
            turn = "looked at" if number % 2 else "quiet"
            if number % 2:
                on.set()
            time.sleep(SETTLE_S)
            first = tick(shop)
            time.sleep(seconds)
            found, skipped = lateness_s(door, first)
            late[turn].append(found)
            skips[turn] += skipped
            if number % 2:
                off.set()
                heard = told.get()
                events, answers, lasted_s = events + heard[0], answers + heard[1], lasted_s + heard[2]
        child.terminate()
    return {
        "us": {turn: percentiles(np.concatenate(values)) for turn, values in late.items()},
        "skips": skips,
        "events per s and listener": events / lasted_s / LISTENERS,
        "answers per s": answers / lasted_s,
    }


def percentiles(values: np.ndarray) -> dict[str, float]:
    """In microseconds; early is not late."""
    late = np.maximum(values, 0.0)
    found = {f"p{p:g}": float(np.percentile(late, p) * 1e6) for p in (50.0, 90.0, 99.0, 99.9)}
    return {**found, "max": float(late.max() * 1e6), "ticks": len(late)}


def told(found: dict[str, Any], busy: str) -> list[Figure]:
    """The lateness of ``busy`` turns beside that of quiet ones."""
    us = found["us"]
    return [
        Figure(f"late, {busy}, {name}", us[busy][name], "us", quiet, "quiet")
        for name, quiet in us["quiet"].items()
        if name != "ticks"
    ]


def report(short: bool) -> Report:
    found = measure(1 if short else 6, 0.5 if short else 5.0, PERIOD_S, NICE)
    answers = found["answers per s"]
    more = [
        Figure("answers", float(answers), "1/s", float(PER_S), "asked"),  # type: ignore[arg-type]
        Figure("events to each", float(found["events per s and listener"]), "1/s"),  # type: ignore[arg-type]
    ]
    note = f"bound: p99 at most {BOUND} times; skips {found['skips']}"
    if answers < ENOUGH * PER_S:  # type: ignore[operator]
        note += "; the load did not come about: this computer has no time for it, these figures say nothing"
    return Report((*told(found, "looked at"), *more), note=note)


if __name__ == "__main__":
    figures.main(report)
