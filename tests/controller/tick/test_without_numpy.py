"""What plan sends is unpacked and evaluated without numpy, to the same last bit; nothing is loaded for it."""

from __future__ import annotations

import inspect
import pickle
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import pytest
from support.machines.interrupted_runs import TIPS
from support.machines.planner_bench import PlannerBench
from support.machines.stepped_runs import T2, program, shipped
from support.machines.tapping import Tapper
from support.parts import random_surfaces, surface_trains
from support.parts.nurbs_text import blade, nurbs

from controller.geometry.placement import Placed
from controller.ipc import piece_socket
from controller.ipc.handoff import PieceMessage
from controller.machine.kinematics import kinematics_of
from controller.machine.model import Machine
from controller.motion.motions import SurfaceCut

CURVE = "G21 G90 G54 G61 G17\nG0 X0 Y0 Z40\nG5 X20 Y8 I8 J12 P-6 Q6 F1500\nM30\n"
ROUNDED = TIPS.replace("S8000 M3", "")
TAP = "G21 G90 G54 G40\nS800 M3\nG0 X5. Y-50.\nG0 Z40.\nG33.1 Z30. K1.\nG0 Z60.\nM30\n"


def evaluated(machine: Machine, messages: list[PieceMessage]) -> list[Any]:
    kinematics, found = kinematics_of(machine), []
    for message in messages:
        for motion in message.motions.values():
            near = (0.0, 0.0)
            for k in range(9):
                joints = motion.joints(motion.end * k / 8, near, kinematics)
                near = kinematics.rotaries(joints) if joints is not None else near
                found.append((joints, near))
        for law in (piece.law for piece in message.pieces):
            found += [law.at(law.duration_s * k / 8) for k in range(9)]
        found += [(table.end_s, list(table.jerks)) for table in message.stops]
    return found


CHILD = f"""
from __future__ import annotations
import pickle, sys
sys.modules["numpy"] = None  # whoever asks for it fails
from controller.machine.kinematics import builds, kinematics_of
from controller.runtime import tick_process

{inspect.getsource(evaluated)}
builds()  # which the tick looks for when it is made
found, loaded = {{}}, set(sys.modules)
for name, sent in pickle.load(sys.stdin.buffer).items():
    try:
        found[name] = evaluated(*pickle.loads(sent))
    except Exception as error:
        found[name] = repr(error)
    if more := set(sys.modules) - loaded:  # a tick would have had to wait for it
        found[name] = f"loaded: {{sorted(more)}}"
        loaded |= more
sys.stdout.buffer.write(pickle.dumps(found))
"""


PERIOD_S = 0.01  # what is sent does not depend on how often it is looked at


Sent = tuple[Machine, list[PieceMessage]]


def sent(text: str, name: str = "trunnion") -> Sent:
    bench = PlannerBench(text, shipped(name, period_s=PERIOD_S))
    bench.run()
    assert bench.planner.finished_path
    return bench.machine, bench.sent


def surfaces(name: str, text: str = "example2_ready") -> Sent:
    return sent(program(text, "2000."), name)


def placed() -> Sent:
    """Two twisted surfaces that are cut along a free axis, one after another."""
    machine, messages = sent(random_surfaces.text(random_surfaces.compound(21, 2), 2000.0, "G42 P3 R0.5"))
    motions = {k: motion for message in messages for k, motion in message.motions.items()}
    surfaces = [one.surface for one in motions.values() if isinstance(one, SurfaceCut)]
    assert sum(isinstance(one, Placed) and one.through is not None for one in surfaces) == 2
    return machine, messages


def placed_at_two_points(name: str) -> Sent:
    """Two cuts of one short surface each."""
    first, second = (surface_trains.program(1, turned_rad=by).replace("P1", "P2") for by in (0.0, 0.4))
    return sent(first.partition("M5")[0] + "G41" + second.partition("G41")[2], name)


def a_blade() -> Sent:
    upper, lower = blade()
    return sent(T2.format(side="G42", cuts=nurbs(upper, lower, " F1000.")))


def tapping() -> Sent:
    """On the stepped clock, for a thread is planned by how its spindle turns."""
    messages, packets = list[PieceMessage](), piece_socket.encode

    def noted(message: PieceMessage) -> list[bytes]:
        if not message.is_keepalive:
            messages.append(message)
        return packets(message)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(piece_socket, "encode", noted)
        tapper = Tapper()
        assert tapper.run(TAP).result == "completed"
    return tapper.machine, messages


RUNS: dict[str, tuple[Callable[[], Sent], str]] = {
    "surfaces, two tables": (lambda: surfaces("trunnion"), "SurfaceCut"),
    "surfaces, table and head": (lambda: surfaces("table_head"), "SurfaceCut"),
    "surfaces, oblique": (lambda: surfaces("oblique45"), "SurfaceCut"),
    "surfaces, placed": (placed, "SurfaceCut"),
    "surfaces, placed at two points": (lambda: placed_at_two_points("head_head"), "SurfaceCut"),
    "cone": (lambda: surfaces("trunnion", "example1_ready"), "SurfaceCut"),
    "blade": (a_blade, "SurfaceCut"),
    "five-axis lines, rounded": (lambda: sent(ROUNDED), "ToolSpline"),
    "five-axis lines, exact": (lambda: sent(ROUNDED.replace("G64 P0.02 Q0.1", "G61")), "ToolLine"),
    "curve": (lambda: sent(CURVE), "JointMove"),
    "curve, three axes": (lambda: sent(CURVE, "three_axes"), "JointMove"),
    "thread": (tapping, "ThreadMove"),
}


@pytest.fixture(scope="module")
def everything() -> dict[str, Sent]:
    """The machine and every message that goes to its tick, of each program."""
    return {name: planned() for name, (planned, _) in RUNS.items()}


@pytest.fixture(scope="module")
def without_numpy(everything: dict[str, Sent]) -> dict[str, Any]:
    """What a process that has no numpy makes of each."""
    told = pickle.dumps({name: pickle.dumps(sent) for name, sent in everything.items()})
    done = subprocess.run([sys.executable, "-c", CHILD], input=told, capture_output=True, timeout=120)
    assert done.returncode == 0, done.stderr.decode()
    found: dict[str, Any] = pickle.loads(done.stdout)
    return found


def test_what_the_plan_sends_needs_no_numpy(
    everything: dict[str, Sent], without_numpy: dict[str, Any]
) -> None:
    for name, (machine, messages) in everything.items():
        kinds = {type(motion).__name__ for message in messages for motion in message.motions.values()}
        assert RUNS[name][1] in kinds, (name, kinds)
        assert without_numpy[name] == evaluated(machine, messages), name
