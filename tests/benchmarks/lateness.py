"""How late SYNC leaves, beside ``cyclictest`` (Debian: rt-tests) in the same run.

    python tests/benchmarks/lateness.py [--seconds S] [--rounds R] [--period-ms P] [--json]

Both take turns with the same period and priority on the same computer, so that a
noisy neighbour meets both. ``cyclictest`` measures how late a thread in C wakes up; the
loop is measured at its SYNC: lateness when the tick begins, and intervals between SYNCs by
the kernel's time stamps at the far end of the socket. A simple echo plays five drives there.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import re
import select
import shutil
import socket
import struct
import subprocess
import sys
import time
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parents[1])]

from support.machines.shipped_kinds import machine as make_machine  # noqa: E402

from controller.ipc.handoff import (  # noqa: E402
    COLUMN,
    PieceInbox,
    Recorder,
    RequestInbox,
    SnapshotBoard,
    piece_pair,
    request_pair,
    send_request,
)
from controller.machine.model import Machine  # noqa: E402
from controller.state.modes import Request  # noqa: E402
from controller.tick import loop  # noqa: E402
from controller.tick.cycle import Cycle  # noqa: E402
from drives import pdo  # noqa: E402
from drives.bus import HubSocket  # noqa: E402
from drives.cyclic.drive import Drive  # noqa: E402
from drives.cyclic.group import Group  # noqa: E402
from drives.settings import MasterSettings, NodeSettings  # noqa: E402

SO_TIMESTAMPNS = 35
STAMP = struct.Struct("qq")
SAMPLE = re.compile(rb"^\s*\d+:\s*\d+:\s*(-?\d+)\s*$", re.M)
REPORT = (0x1237).to_bytes(2, "little") + bytes(4)  # operation enabled, at zero
WARM_UP = 50  # ticks of each turn that do not count, for both


def run_cyclictest(seconds: float, period_s: float, priority: int) -> np.ndarray:
    """Latencies (s) of one turn of cyclictest, sample by sample."""
    # -v prints every sample; -q would keep it silent
    command = ["cyclictest", "-m", "-N", "-v", "-t1", f"-i{round(period_s * 1e6)}"]
    command += [f"-l{round(seconds / period_s)}", f"-p{priority}"]
    found = subprocess.run(command, capture_output=True, check=False)
    samples = np.array([int(value) for value in SAMPLE.findall(found.stdout)], dtype=float) * 1e-9
    if len(samples) == 0:
        raise SystemExit(f"cyclictest gave no samples: {found.stderr.decode(errors='replace')[:300]}")
    return samples[WARM_UP:]


def tick_process(
    machine: Machine, near: socket.socket, seconds: float, priority: int, out: Connection
) -> None:
    """The real loop and cycle, drives enabled and standing; sends its lateness when done."""
    nodes = [NodeSettings(a.name, a.bus, a.node, "", period_s=machine.period_s) for a in machine.axes]
    group = Group(
        [Drive(node) for node in nodes],
        {machine.axes[0].bus: HubSocket(near, "main")},
        MasterSettings(period_s=machine.period_s),
    )
    _, piece_end = piece_pair()
    operator, request_end = request_pair()
    recorder = Recorder(rows=1 << 17)
    clock = loop.WallClock()
    cycle = Cycle(
        machine,
        group,
        PieceInbox(piece_end),
        RequestInbox(request_end),
        SnapshotBoard(),
        recorder,
        clock.now_s,
    )
    send_request(operator, Request.ENABLE)
    granted = loop.prepare(priority)
    ends_s = time.monotonic() + seconds
    loop.Loop(cycle, clock).run(lambda: time.monotonic() < ends_s)
    rows = recorder.drain()[WARM_UP:]
    out.send((rows[:, COLUMN["lateness_s"]], cycle.skips, dict(granted)))


def play_drives(far: socket.socket, stop: Connection) -> np.ndarray:
    """Answers every SYNC for five drives; returns the kernel's stamps of the SYNCs (s)."""
    far.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
    answers = [bytes(pdo.frame(pdo.TPDO1 + node, REPORT)) for node in range(1, 6)]
    stamps = []
    while True:
        readable, _, _ = select.select([far, stop], [], [], 1.0)
        if far in readable:
            packet, notes, _, _ = far.recvmsg(4096, 64)
            if pdo.HEADER.unpack_from(packet)[0] == pdo.SYNC:
                seconds, nanoseconds = STAMP.unpack(notes[0][2][: STAMP.size])
                stamps.append(seconds + nanoseconds * 1e-9)
                for answer in answers:
                    far.send(answer)
        elif stop in readable:
            return np.array(stamps)


def run_loop(
    seconds: float, period_s: float, priority: int
) -> tuple[np.ndarray, np.ndarray, int, dict[str, bool]]:
    """(lateness, SYNC stamps, skips, privileges) of one turn of our loop."""
    machine = make_machine(period_s=period_s)
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    mine, theirs = multiprocessing.Pipe()
    child = multiprocessing.get_context("fork").Process(
        target=tick_process, args=(machine, near, seconds, priority, theirs)
    )
    child.start()
    stamps = play_drives(far, mine)
    lateness, skips, granted = mine.recv()
    child.join()
    near.close()
    far.close()
    return lateness, stamps[WARM_UP:], skips, granted


def describe(lateness: np.ndarray, deviation: np.ndarray, period_s: float) -> dict[str, float]:
    """Percentiles in microseconds of lateness and of abs(interval - period)."""
    result: dict[str, float] = {}
    for name, values in (("lateness", lateness), ("interval", deviation)):
        p50, p99, p999 = np.percentile(values, (50.0, 99.0, 99.9)) * 1e6
        result |= {f"{name} p50": float(p50), f"{name} p99": float(p99), f"{name} p99.9": float(p999)}
        result[f"{name} max"] = float(values.max()) * 1e6
    result["share outside 1 +- 1/4"] = float(np.mean(deviation > 0.25 * period_s))
    return result


def print_table(ours: dict[str, float], theirs: dict[str, float]) -> None:
    print(f"{'us':<24}{'SYNC':>10}{'cyclictest':>12}{'ratio':>8}")
    for name, value in ours.items():
        other = theirs[name]
        ratio = f"{value / other:8.2f}" if other > 0.0 else "       -"
        if name.startswith("share"):
            print(f"{name:<24}{value:>10.4%}{other:>12.4%}{ratio}")
        else:
            print(f"{name:<24}{value:>10.1f}{other:>12.1f}{ratio}")


def main() -> None:
    arguments = argparse.ArgumentParser(description="lateness of SYNC beside cyclictest")
    arguments.add_argument("--seconds", type=float, default=5.0, help="of each turn")
    arguments.add_argument("--rounds", type=int, default=3)
    arguments.add_argument("--period-ms", type=float, default=2.0)
    arguments.add_argument("--priority", type=int, default=80)
    arguments.add_argument("--json", action="store_true")
    wanted = arguments.parse_args()
    if shutil.which("cyclictest") is None:
        raise SystemExit("cyclictest is missing: apt-get install rt-tests")
    period_s = wanted.period_ms * 1e-3
    lateness, woken, deviation, woken_deviation = [], [], [], []
    skips, granted = 0, {}
    for _ in range(wanted.rounds):
        samples = run_cyclictest(wanted.seconds, period_s, wanted.priority)
        woken.append(samples)
        woken_deviation.append(np.abs(np.diff(samples)))
        late, stamps, skipped, granted = run_loop(wanted.seconds, period_s, wanted.priority)
        lateness.append(late)
        deviation.append(np.abs(np.diff(stamps) - period_s))
        skips += skipped
    ours = describe(np.concatenate(lateness), np.concatenate(deviation), period_s)
    theirs = describe(np.concatenate(woken), np.concatenate(woken_deviation), period_s)
    if wanted.json:
        print(json.dumps({"sync": ours, "cyclictest": theirs, "skips": skips, "granted": granted}))
        return
    print(
        f"period {wanted.period_ms} ms, {wanted.rounds} x {wanted.seconds} s each, priority {wanted.priority}"
    )
    print(f"privileges {granted}, cpus {os.cpu_count()}, skips {skips}")
    print_table(ours, theirs)


if __name__ == "__main__":
    main()
