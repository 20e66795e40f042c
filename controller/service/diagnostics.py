"""What is looked at closely: rows of every tick, how full the buses are, how late ticks came."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from controller.ipc.control_socket import Values
from controller.ipc.handoff import COLUMN, ROW, Recorder
from controller.ipc.packed_rows import packed
from controller.machine.model import Bus, Machine
from controller.runtime.bus_load import budgets
from controller.service.refusals import whole
from controller.tick.sync_watch import LATE_SHARE
from drives import pdo
from drives.load.budget import BusBudget, worst_bits
from drives.log.frame_log import FrameLog

Rows = npt.NDArray[np.float64]

MAX_ROWS = 500  # of one answer: 190 kB where nothing can be compressed
NEWER = 64  # rows that the tick may write while the older ones are counted
MEASURED_S = 1.0
MAX_TICK = 2**53  # whole numbers of JSON end there
SHARES = (0.0, 0.02, 0.05, 0.1, 0.15, 0.2, LATE_SHARE, 0.5, 1.0, 2.0)  # of the period
NEARLY_FULL_SHARE = 0.9  # of the share that the machine file allows a bus: from here on it is nearly full


def rows(recorder: Recorder | None, args: Mapping[str, Any]) -> Values:
    """Rows after the tick ``after`` (null: the last ``kept`` ones), at most ``most``. Raises CommandRefused.

    ``anew``: the ticks count from zero again, so all of them come after that.
    """
    after, most, kept = (whole(args, name, MAX_TICK) for name in ("after", "most", "kept"))
    newest = recorder.last(1) if recorder is not None else np.empty((0, len(ROW)))
    if recorder is None or not len(newest):
        return {**packed(newest), "anew": False}
    tick = int(newest[-1, COLUMN["tick"]])
    anew = after is not None and after > tick
    oldest = tick - (recorder.rows if kept is None else kept)
    since = oldest if after is None or anew else max(after, oldest)
    found = _later(recorder, since, max(0, tick - since) + NEWER)
    fresh = found[found[:, COLUMN["tick"]] > since]
    return {**packed(fresh[: min(MAX_ROWS, most or MAX_ROWS)]), "anew": anew}


def _later(recorder: Recorder, since: int, count: int) -> Rows:
    """All rows after the tick ``since``, if they are there: usually among the newest ``count``.

    While they are counted the tick goes on writing, for long where this process has to wait.
    """
    found = recorder.last(count)
    while found[0, COLUMN["tick"]] > since and len(found) == count:
        count *= 2
        found = recorder.last(count)
    return found


def lateness(found: Rows, period_s: float) -> Values:
    """How late these ticks came: ``from_us[i]`` to ``from_us[i + 1]`` are ``ticks[i]`` of them.

    From ``skipped_from_us`` on a tick sends nothing.
    """
    edges_s = np.array(SHARES) * period_s
    late_s = np.maximum(found[:, COLUMN["lateness_s"]], 0.0)
    places = np.searchsorted(edges_s, late_s, side="right") - 1
    return {
        "from_us": [round(float(edge) * 1e6, 3) for edge in edges_s],
        "ticks": np.bincount(places, minlength=len(SHARES)).tolist(),
        "skipped_from_us": round(LATE_SHARE * period_s * 1e6, 3),
        "seconds": len(found) * period_s,
    }


def buses(machine: Machine, logs: Mapping[str, FrameLog], recorder: Recorder | None) -> Values:
    """Each bus as it was budgeted, and as it was heard in the last second; late ticks of the last minute."""
    late = recorder.last(recorder.rows) if recorder is not None else np.empty((0, len(ROW)))
    found = [_bus(bus, machine, budget, logs.get(bus.name)) for bus, budget in _budgeted(machine)]
    most = machine.max_bus_share
    late_ticks = lateness(late, machine.period_s)
    return {"buses": found, "max_share": most, "near_share": NEARLY_FULL_SHARE * most, "lateness": late_ticks}


def _budgeted(machine: Machine) -> list[tuple[Bus, BusBudget]]:
    return list(zip(machine.buses, budgets(machine), strict=True))


def _bus(bus: Bus, machine: Machine, budget: BusBudget, log: FrameLog | None) -> Values:
    shown = {
        "name": bus.name,
        "interface": bus.interface,
        "bit_rate": bus.bit_rate,
        "drives": budget.drives,
        "budget_share": budget.share if bus.bit_rate else None,
        "background_share": budget.background_us / budget.period_us if bus.bit_rate else None,
    }
    return {**shown, **measured(log, bus.bit_rate, machine.period_s)}


def measured(log: FrameLog | None, bit_rate: int, period_s: float) -> Values:
    """What was heard in the last second; each frame counts with the most bits it can have."""
    kept = list(log.frames()) if log is not None else []
    since_s = time.time() - MEASURED_S
    bits, ticks, frames = 0, [0], 0
    errors: list[tuple[float, bytes]] = []
    for at_s, frame in kept:
        can_id, length, data = pdo.FRAME.unpack(frame)
        if can_id & pdo.ERROR_FLAG:
            errors.append((at_s, data))
        elif at_s >= since_s:
            if can_id == pdo.SYNC:
                ticks.append(0)
            frames, bits = frames + 1, bits + worst_bits(length)
            ticks[-1] += worst_bits(length)
    timed = bit_rate > 0 and frames > 0
    return {
        "frames_per_s": round(frames / MEASURED_S),
        "measured_share": bits / bit_rate / MEASURED_S if timed else None,
        "fullest_share": max(ticks) / bit_rate / period_s if timed and len(ticks) > 2 else None,
        "error_frames": len(errors),
        # SocketCAN's error frames carry the controller's counters in their last two bytes.
        "transmit_errors": errors[-1][1][6] if errors else None,
        "receive_errors": errors[-1][1][7] if errors else None,
    }
