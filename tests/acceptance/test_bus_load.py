"""A plan that the budget refuses does overrun the bus, and one that it accepts never does.

Frames take as long as they can here: what the budget judges by, and what a payload may ask for any tick.
"""

from __future__ import annotations

import math
import random

import pytest
from support.machines.stepped_runs import cut, program, shipped
from support.oracles.bus_times import Wire, take_the_worst

from controller.messages import text
from controller.runtime.bus_load import budgets, overload
from controller.runtime.startup import SessionError
from controller.runtime.stepped import SteppedMachine
from controller.state.modes import Fault
from drives import pdo
from drives.bench.virtual.virtual_bus import Handler, Link, SteppedBus
from drives.load import budget
from drives.settings import BusSettings, MasterSettings, NodeSettings

MASTER = MasterSettings()
BUS = BusSettings("can", "virtual", "", 1_000_000)


class Answering:
    """As much of a drive as the wire knows: feedback at once after SYNC, a heartbeat at its own times."""

    def __init__(self, node: int, first_beat_s: float) -> None:
        self.due_s = first_beat_s
        self._node, self._link = node, None
        self._feedback = bytes(pdo.frame(pdo.TPDO1 + node, bytes(6)))
        self._beat = bytes(pdo.frame(pdo.HEARTBEAT + node, b"\x05"))

    def join(self, link: Link, _now_s: float) -> None:
        self._link = link

    def listens(self) -> dict[int, Handler]:
        return {pdo.SYNC: self._answer}

    def _answer(self, _frame: bytes, at_s: float) -> None:
        assert self._link is not None
        self._link.send(at_s, pdo.TPDO1 + self._node, self._feedback)

    def timer(self, now_s: float) -> None:
        assert self._link is not None
        self.due_s = now_s + MASTER.heartbeat_s
        self._link.send(now_s, pdo.HEARTBEAT + self._node, self._beat)


def bare_ticks(drives: int, period_s: float, ticks: int, seed: int = 1) -> Wire:
    """SYNC, setpoints and heartbeats on a bus with answering nodes; heartbeats come when they are worst."""
    rng = random.Random(seed)
    nodes = [NodeSettings(f"N{n}", "can", n, "") for n in range(1, drives + 1)]
    (planned,) = budget.of(nodes, [BUS], MASTER, period_s)
    bus = SteppedBus(BUS.bit_rate, worst_stuffing=True)
    port = bus.port()
    for node in nodes:
        # Now and then one begins just before a SYNC, which has to wait for it.
        bus.attach(Answering(node.node, rng.choice((period_s - 1e-6, rng.uniform(0.0, 0.05)))))
    wire = Wire(bus, planned)
    setpoints = b"".join(pdo.frame(pdo.RPDO1 + node.node, bytes(6)) for node in nodes)
    beat = pdo.frame(pdo.HEARTBEAT + MASTER.node_id, b"\x05")
    every = max(1, round(MASTER.heartbeat_s / period_s))
    for tick in range(1, ticks + 1):
        bus.advance(tick * period_s)
        port.send(pdo.frame(pdo.SYNC))
        port.send(setpoints)
        if tick % every == 0:
            port.send(beat)
    return wire


@pytest.mark.parametrize("period_s", [0.0005, 0.001, 0.002])
@pytest.mark.parametrize("drives", range(1, 9))
def test_the_bus_overruns_where_the_budget_says_so_and_nowhere_else(drives: int, period_s: float) -> None:
    wire = bare_ticks(drives, period_s, 400)
    assert wire.uncounted() == set()
    if wire.budget.spare_us >= 0.0:
        assert wire.overruns() == 0
        return
    assert not wire.budget.fits(1.0)
    if wire.budget.total_us > wire.budget.period_us:
        # A little too much shows in some ticks only: a frame of backlog must gather first.
        assert wire.overruns() > 0
        assert wire.bus.busy_s > 0.99 * (wire.bus.now_s - period_s)


def test_a_machine_whose_tick_is_refused_does_not_even_come_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Five drives at 1 ms on one bus: feedback and setpoints do not come, queues fill, a fault says so."""
    take_the_worst(monkeypatch)
    stepped = SteppedMachine(shipped("trunnion", period_s=0.001))
    (planned,) = budgets(stepped.machine)
    assert "2 buses" in text(overload(stepped.machine))
    wire = Wire(stepped.rig.buses[planned.bus], planned)
    with pytest.raises(SessionError):
        stepped.come_up()
    assert stepped.cycle.modes.fault in (Fault.SEND_FAILED, Fault.FEEDBACK_LOST, Fault.STATE_LOST)
    wire.forget()
    for _ in range(300):
        stepped.tick()
    assert wire.overruns() > 0.9 * len(wire.syncs_s)
    came = [wire.per_tick(row.can_id) for row in planned.cyclic]
    assert math.isclose(wire.busy_us_per_tick(), 1000.0, rel_tol=0.3)
    assert min(one.sum() for one in came) < len(came[0])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_a_bus_as_full_as_the_budget_allows_never_overruns_in_200_000_ticks(seed: int) -> None:
    """Six drives at 2 ms are 71.8 % of the tick, four at 1 ms (97.5 %) are refused for one heartbeat.

    The seed says when each drive's heartbeats come.
    """
    wire = bare_ticks(6, 0.002, 10_001, seed)
    assert wire.budget.fits()
    assert len(wire.syncs_s) >= 10_000
    assert wire.overruns() == 0


@pytest.mark.slow
@pytest.mark.parametrize("feed", [f"{feed}." for feed in range(300, 3301, 300)])
def test_a_cutting_machine_never_overruns_its_bus_in_100_000_ticks(feed: str) -> None:
    stepped = SteppedMachine(shipped("trunnion"))
    stepped.come_up()
    (planned,) = budgets(stepped.machine)
    wire = Wire(stepped.rig.buses[planned.bus], planned)
    while len(wire.syncs_s) < 10_000:
        assert cut(program("example2_ready.ngc", feed), stepped=stepped).run.result == "completed"
    assert wire.overruns() == 0 and wire.uncounted() == set()
