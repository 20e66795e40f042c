"""Bus time: whether the frames of a tick fit into the tick, before anything is opened.

A classic CAN data frame of n bytes with an 11-bit identifier has 44 + 8n bits, 3 of
interframe space, and a stuff bit after every four bits at worst in the 34 + 8n
that are stuffed (after the first five, each stuff bit counts for the next run):

    worst(n) = 8n + 47 + floor((34 + 8n - 1) / 4)        0: 55   4: 95   6: 115   8: 135

Random contents get a stuff bit per 16 bits or so. A period is judged by the worst
case: a machine whose bus fits most of the time stops in the middle of some cut.
Judged are the frames of every tick (SYNC, RPDO1, TPDO1) plus the heartbeats, which
come seldom and are counted by their share. SDO is not: the slow side asks one
question at a time, and the room left must hold it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from drives import pdo
from drives.settings import BusSettings, MasterSettings, NodeSettings

MAX_SHARE = 0.8
PERIODS_S = (0.0005, 0.001, 0.002, 0.004, 0.005, 0.010)  # what CiA 402 drives take, and one that few do
FASTEST_BIT_RATE = 1_000_000


def worst_bits(data_bytes: int) -> int:
    """Bits of a frame with interframe space, stuffed as badly as can be."""
    return 8 * data_bytes + 47 + (34 + 8 * data_bytes - 1) // 4


def typical_bits(data_bytes: int) -> float:
    """Bits of a frame with interframe space for random contents."""
    return 8 * data_bytes + 47 + (34 + 8 * data_bytes) / 16


@dataclass(frozen=True, slots=True)
class Row:
    """One kind of frame on one bus."""

    what: str
    can_id: int
    data_bytes: int
    per_tick: float  # frames per tick; below 1 for what comes seldom
    worst_us: float  # of one frame
    typical_us: float


@dataclass(frozen=True, slots=True)
class BusBudget:
    """What one bus carries per tick. Without bit timing (bit rate 0) all times are 0."""

    bus: str
    bit_rate: int
    period_us: float
    drives: int
    cyclic: tuple[Row, ...]  # in every tick
    background: tuple[Row, ...]  # now and then

    @property
    def total_us(self) -> float:
        """Worst-case time of the frames of every tick."""
        return sum(row.worst_us * row.per_tick for row in self.cyclic)

    @property
    def typical_us(self) -> float:
        """The same for random contents."""
        return sum(row.typical_us * row.per_tick for row in self.cyclic)

    @property
    def background_us(self) -> float:
        """Heartbeats, averaged over the ticks."""
        return sum(row.worst_us * row.per_tick for row in self.background)

    @property
    def share(self) -> float:
        """Worst-case share of a tick taken by the frames of every tick."""
        return self.total_us / self.period_us

    def fits(self, max_share: float = MAX_SHARE) -> bool:
        """Whether every tick's frames and the heartbeats stay below ``max_share`` of the period."""
        return self.total_us + self.background_us <= max_share * self.period_us

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {
            "bus": self.bus,
            "bit_rate": self.bit_rate,
            "period_us": self.period_us,
            "drives": self.drives,
            "rows": [asdict(row) for row in self.cyclic + self.background],
            "total_us": self.total_us,
            "typical_us": self.typical_us,
            "background_us": self.background_us,
            "share": self.share,
            "typical_share": self.typical_us / self.period_us,
        }


def of(
    nodes: Sequence[NodeSettings],
    buses: Sequence[BusSettings],
    master: MasterSettings,
    period_s: float | None = None,
) -> list[BusBudget]:
    """The budget of each bus, in the order of ``buses``; ``period_s`` defaults to the master's."""
    period_s = master.period_s if period_s is None else period_s
    return [_of_bus(bus, [n for n in nodes if n.bus == bus.name], master, period_s) for bus in buses]


def _of_bus(
    bus: BusSettings, nodes: Sequence[NodeSettings], master: MasterSettings, period_s: float
) -> BusBudget:
    beats = period_s / master.heartbeat_s
    cyclic = [_row("SYNC", pdo.SYNC, 0, 1.0, bus.bit_rate)]
    for node in nodes:
        cyclic.append(
            _row(f"setpoint of {node.name}", pdo.RPDO1 + node.node, pdo.PDO_BYTES, 1.0, bus.bit_rate)
        )
        cyclic.append(
            _row(f"feedback of {node.name}", pdo.TPDO1 + node.node, pdo.PDO_BYTES, 1.0, bus.bit_rate)
        )
    background = [_row("heartbeat of the controller", pdo.HEARTBEAT + master.node_id, 1, beats, bus.bit_rate)]
    for node in nodes:
        what = f"heartbeat of {node.name}"
        background.append(_row(what, pdo.HEARTBEAT + node.node, 1, beats, bus.bit_rate))
    return BusBudget(bus.name, bus.bit_rate, period_s * 1e6, len(nodes), tuple(cyclic), tuple(background))


def _row(what: str, can_id: int, data_bytes: int, per_tick: float, bit_rate: int) -> Row:
    bit_us = 1e6 / bit_rate if bit_rate else 0.0
    worst, typical = worst_bits(data_bytes) * bit_us, typical_bits(data_bytes) * bit_us
    return Row(what, can_id, data_bytes, per_tick, worst, typical)


def advice(
    nodes: Sequence[NodeSettings],
    buses: Sequence[BusSettings],
    master: MasterSettings,
    max_share: float = MAX_SHARE,
    period_s: float | None = None,
) -> list[str]:
    """One sentence for each bus that does not fit, saying what would; empty if all fit."""
    budgets = of(nodes, buses, master, period_s)
    return [
        _refusal(budget, [n for n in nodes if n.bus == bus.name], bus, master, max_share)
        for budget, bus in zip(budgets, buses, strict=True)
        if not budget.fits(max_share)
    ]


def _refusal(
    budget: BusBudget,
    nodes: Sequence[NodeSettings],
    bus: BusSettings,
    master: MasterSettings,
    max_share: float,
) -> str:
    needed = budget.total_us + budget.background_us
    remedies = [
        text
        for text in (
            _longer_period(nodes, bus, master, max_share),
            _more_buses(budget, max_share),
            _faster(budget, max_share),
        )
        if text
    ]
    what_fits = f"what would fit: {', or '.join(remedies)}" if remedies else "nothing at this bus would fit"
    return (
        f"bus {budget.bus}: {budget.drives} drives need {needed:.0f} us of every {budget.period_us:.0f} us"
        f" at worst ({needed / budget.period_us:.0%}), allowed are {max_share:.0%}; {what_fits}"
    )


def _longer_period(
    nodes: Sequence[NodeSettings], bus: BusSettings, master: MasterSettings, max_share: float
) -> str:
    fitting = (p for p in PERIODS_S if _of_bus(bus, nodes, master, p).fits(max_share))
    period_s = next(fitting, None)
    return "" if period_s is None else f"a period of {period_s * 1000:g} ms"


def _more_buses(budget: BusBudget, max_share: float) -> str:
    """So many buses that the fullest fits: each carries its SYNC and the controller's heartbeat."""
    fixed = budget.cyclic[0].worst_us + budget.background[0].worst_us * budget.background[0].per_tick
    whole = budget.total_us + budget.background_us
    for buses in range(2, budget.drives + 1):
        most = -(-budget.drives // buses)
        if fixed + (whole - fixed) / budget.drives * most <= max_share * budget.period_us:
            return f"{buses} buses with at most {most} {'drive' if most == 1 else 'drives'} each"
    return ""


def _faster(budget: BusBudget, max_share: float) -> str:
    needed = (budget.total_us + budget.background_us) * budget.bit_rate / FASTEST_BIT_RATE
    if budget.bit_rate >= FASTEST_BIT_RATE or needed > max_share * budget.period_us:
        return ""
    return f"a bit rate of {FASTEST_BIT_RATE // 1000} kbit/s"
