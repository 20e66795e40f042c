"""Bus time: whether the frames of a tick fit into the tick, before anything is opened.

Judged is the worst tick: SYNC, every drive's setpoint and every drive's feedback, each frame as long
as bit stuffing allows (``drives.load.stuffing``). A machine whose bus fits most of the time stops in the
middle of some cut. Feedback with every n-th SYNC counts whole: without a SYNC counter, which drives do
not have, all answer the same SYNC.

    share of the period:  worst tick + background, averaged         <= max_share
    order on the wire:    worst tick + one frame that is in its way <= period

The second is about priority. Heartbeats, guarding and commands on change have higher identifiers than
setpoints, so of all that at most one frame, already on the wire, is in the way; inputs and outputs may
have lower ones and go before. Emergencies go before all, but come with a fault. SDO is paced:
``sdo_every`` says how many ticks apart its questions may be.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from drives.load import bus_frames
from drives.load.bus_frames import Kind, Row
from drives.load.stuffing import worst_bits
from drives.profile import Profile
from drives.settings import BusSettings, IoSettings, MasterSettings, NodeSettings, SpindleSettings
from drives.texts import Message, message

__all__ = ["MAX_SHARE", "BusBudget", "Row", "advice", "of", "worst_bits"]

MAX_SHARE = 0.8
PERIODS_S = (0.0005, 0.001, 0.002, 0.004, 0.005, 0.010)  # what CiA 402 drives take, and one that few do
FASTEST_BIT_RATE = 1_000_000

Other = SpindleSettings | IoSettings


@dataclass(frozen=True, slots=True)
class BusBudget:
    """What one bus carries per tick. Without bit timing (bit rate 0) all times are 0."""

    bus: str
    bit_rate: int
    period_us: float
    drives: int
    cyclic: tuple[Row, ...]  # with every SYNC, or every n-th and then all together
    background: tuple[Row, ...]  # at intervals of many ticks
    occasional: tuple[Row, ...] = ()  # with an event, and SDO

    @property
    def rows(self) -> tuple[Row, ...]:
        return (*self.cyclic, *self.background, *self.occasional)

    @property
    def total_us(self) -> float:
        """Worst-case time of the frames of the fullest tick."""
        return sum(row.worst_us for row in self.cyclic)

    @property
    def longest_us(self) -> float:
        """The same with the very payloads that make each frame as long as it can be."""
        return sum(row.longest_us for row in self.cyclic)

    @property
    def typical_us(self) -> float:
        """Time of a tick's frames in operation, mean over ticks and payloads."""
        return sum(row.typical_us * row.per_tick for row in self.cyclic)

    @property
    def background_us(self) -> float:
        """Heartbeats and the like at their worst, averaged over the ticks."""
        return sum(row.worst_us * row.per_tick for row in self.background)

    @property
    def crowded_us(self) -> float:
        """All at once: fullest tick, every heartbeat, an emergency of every node, one SDO pair."""
        return sum(row.worst_us for row in self.rows)

    @property
    def share(self) -> float:
        """Worst-case share of a tick taken by the frames of the fullest tick."""
        return self.total_us / self.period_us

    @property
    def last_us(self) -> float:
        """From SYNC's turn until the last setpoint is across, with what may go before it or is in its way."""
        lowest = max(row.can_id for row in self.cyclic)
        others = [
            row for row in (*self.background, *self.occasional) if not row.is_emergency and not row.is_sdo
        ]
        before = sum(row.worst_us for row in others if row.can_id < lowest)
        return self.total_us + before + max((r.worst_us for r in others if r.can_id > lowest), default=0.0)

    @property
    def spare_us(self) -> float:
        """How late a tick may send and still have its setpoints across when the next SYNC is due."""
        return self.period_us - self.last_us

    def fits(self, max_share: float = MAX_SHARE) -> bool:
        """Whether the fullest tick leaves 1 - ``max_share`` free and ends before the next SYNC."""
        judged_us = self.total_us + self.background_us
        return judged_us <= max_share * self.period_us and self.spare_us >= 0.0

    def sdo_every(self, max_share: float = MAX_SHARE) -> int | None:
        """Ticks from one SDO question to the next that keep the share; None = none while it runs."""
        pair_us = [row.worst_us for row in self.occasional if row.is_sdo]
        room_us = max_share * self.period_us - self.total_us - self.background_us
        if room_us <= 0.0 or self.total_us + max(pair_us, default=0.0) > self.period_us:
            return None if self.bit_rate else 1
        return max(1, math.ceil(sum(pair_us) / room_us))

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON; times in us."""
        return {
            "bus": self.bus,
            "bit_rate": self.bit_rate,
            "period_us": self.period_us,
            "drives": self.drives,
            "rows": [row.to_dict() for row in self.rows],
            "total_us": self.total_us,
            "longest_us": self.longest_us,
            "typical_us": self.typical_us,
            "background_us": self.background_us,
            "crowded_us": self.crowded_us,
            "last_setpoint_us": self.last_us,
            "spare_us": self.spare_us,
            "share": self.share,
            "typical_share": self.typical_us / self.period_us,
        }


def of(
    nodes: Sequence[NodeSettings],
    buses: Sequence[BusSettings],
    master: MasterSettings,
    period_s: float | None = None,
    spindle: SpindleSettings | None = None,
    io: Sequence[IoSettings] = (),
) -> list[BusBudget]:
    """The budget of each bus, in the order of ``buses``; ``period_s`` defaults to the master's."""
    plan = _Plan(tuple(nodes), tuple(buses), master, period_s or master.period_s, _others(spindle, io))
    return plan.budgets()


def advice(
    nodes: Sequence[NodeSettings],
    buses: Sequence[BusSettings],
    master: MasterSettings,
    max_share: float = MAX_SHARE,
    period_s: float | None = None,
    spindle: SpindleSettings | None = None,
    io: Sequence[IoSettings] = (),
) -> list[Message]:
    """One text for each bus that does not fit, saying what would; empty if all fit."""
    plan = _Plan(tuple(nodes), tuple(buses), master, period_s or master.period_s, _others(spindle, io))
    return [
        _refusal(plan, bus, budget, max_share)
        for bus, budget in zip(plan.buses, plan.budgets(), strict=True)
        if not budget.fits(max_share)
    ]


def _others(spindle: SpindleSettings | None, io: Sequence[IoSettings]) -> tuple[Other, ...]:
    return (*io,) if spindle is None else (spindle, *io)


@dataclass(frozen=True, slots=True)
class _Plan:
    """Who is on which bus at which period: what the remedies change one thing of."""

    nodes: tuple[NodeSettings, ...]
    buses: tuple[BusSettings, ...]
    master: MasterSettings
    period_s: float
    others: tuple[Other, ...]

    def budgets(self) -> list[BusBudget]:
        return [self.budget(bus) for bus in self.buses]

    def budget(self, bus: BusSettings) -> BusBudget:
        nodes, others = self.nodes_on(bus), [one for one in self.others if one.bus == bus.name]
        rows = bus_frames.of(bus, nodes, self.master, self.period_s, others)
        kinds = (tuple(row for row in rows if row.kind is kind) for kind in Kind)
        return BusBudget(bus.name, bus.bit_rate, self.period_s * 1e6, len(nodes), *kinds)

    def nodes_on(self, bus: BusSettings) -> list[NodeSettings]:
        return [node for node in self.nodes if node.bus == bus.name]


# --- what would fit ------------------------------------------------------------------------


def _refusal(plan: _Plan, bus: BusSettings, budget: BusBudget, max_share: float) -> Message:
    found = (
        _longer_period(plan, bus, max_share),
        _more_buses(plan, bus, max_share),
        _other_bus(plan, bus, max_share),
        _without_feed_forward(plan, bus, max_share),
        _faster(plan, bus, max_share),
    )
    problem = _problem(budget, max_share)
    remedies = [one for one in found if one is not None]
    if not remedies:
        return message("budget.nothing_fits", bus=budget.bus, problem=problem)
    fits = remedies[-1]
    for one in remedies[-2::-1]:
        fits = message("budget.or", one=one, other=fits)
    return message("budget.fits", bus=budget.bus, problem=problem, fits=fits)


def _problem(budget: BusBudget, max_share: float) -> Message:
    needed_us, period_us = budget.total_us + budget.background_us, budget.period_us
    key = "budget.drive_needs" if budget.drives == 1 else "budget.drives_need"
    figures = {"needed": needed_us, "period": period_us, "share": needed_us / period_us}
    who = message(key, drives=budget.drives, **figures)
    if needed_us > max_share * period_us:
        return message("budget.over", who=who, allowed=max_share)
    return message("budget.late", who=who, last=budget.last_us)


def _longer_period(plan: _Plan, bus: BusSettings, max_share: float) -> Message | None:
    profiles = [node.profile for node in plan.nodes]
    periods = (p for p in PERIODS_S if p > plan.period_s and all(_takes(profile, p) for profile in profiles))
    longer = (replace(plan, period_s=period_s) for period_s in periods)
    fitting = next((p for p in longer if p.budget(bus).fits(max_share)), None)
    return None if fitting is None else message("budget.period", period=fitting.period_s * 1000.0)


def _takes(profile: Profile, period_s: float) -> bool:
    """Whether drives of this family take the period at all."""
    steps = period_s / profile.period_step_s
    whole = abs(steps - round(steps)) < 1e-6
    return whole and profile.period_min_s - 1e-9 <= period_s <= profile.period_max_s + 1e-9


def _more_buses(plan: _Plan, bus: BusSettings, max_share: float) -> Message | None:
    """So many buses that each fits, the axes in their order; spindle and I/O stay on the last."""
    nodes = plan.nodes_on(bus)
    for count in range(2, len(nodes) + 1):
        most = -(-len(nodes) // count)
        shares = [nodes[at : at + most] for at in range(0, len(nodes), most)]
        lanes = [replace(bus, name=f"{bus.name}.{n}") for n in range(len(shares) - 1)] + [bus]
        moved = (
            replace(node, bus=lane.name) for lane, few in zip(lanes, shares, strict=True) for node in few
        )
        split = replace(plan, nodes=tuple(moved), buses=tuple(lanes))
        if all(one.fits(max_share) for one in split.budgets()):
            who = " | ".join(" ".join(node.name for node in few) for few in shares)
            key = "budget.buses_of_one" if most == 1 else "budget.buses"
            return message(key, count=count, most=most, who=who)
    return None


def _other_bus(plan: _Plan, bus: BusSettings, max_share: float) -> Message | None:
    """One axis over to a bus that is there and has room."""
    for node in reversed(plan.nodes_on(bus)):
        for other in plan.buses:
            moved = tuple(replace(n, bus=other.name) if n is node else n for n in plan.nodes)
            there = replace(plan, nodes=moved)
            taken = any(n.node == node.node for n in plan.nodes_on(other))
            if other is not bus and all(there.budget(one).fits(max_share) for one in (bus, other)):
                key = "budget.other_bus_renumbered" if taken else "budget.other_bus"
                return message(key, name=node.name, bus=other.name)
    return None


def _without_feed_forward(plan: _Plan, bus: BusSettings, max_share: float) -> Message | None:
    names = [node.name for node in plan.nodes_on(bus) if node.feed_forward]
    plain = replace(plan, nodes=tuple(replace(node, feed_forward=False) for node in plan.nodes))
    if not names or not plain.budget(bus).fits(max_share):
        return None
    return message("budget.no_feed_forward", names=" ".join(names))


def _faster(plan: _Plan, bus: BusSettings, max_share: float) -> Message | None:
    fast = replace(bus, bit_rate=FASTEST_BIT_RATE)
    if bus.bit_rate >= FASTEST_BIT_RATE or not plan.budget(fast).fits(max_share):
        return None
    return message("budget.bit_rate", rate=FASTEST_BIT_RATE // 1000)
