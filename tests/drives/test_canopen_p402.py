"""canopen's own CiA 402 profile, as it comes, leads a simulated drive over the hub."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import canopen
import pytest
from canopen.profiles.p402 import BaseNode402
from support.drives.hub_process import ANSWER_S, served
from support.drives.stepped_drives import EDS

from drives.bench.virtual.hub_bus import HubBus

NODE = 1


@pytest.fixture
def node(tmp_path: Path) -> Iterator[BaseNode402]:
    path = tmp_path / "can"
    with served(path, "--nodes", str(NODE), nodes=[NODE]):
        network = canopen.Network(bus=HubBus(str(path)))
        network.connect()
        made = BaseNode402(NODE, EDS)
        network.add_node(made)
        made.sdo.RESPONSE_TIMEOUT = ANSWER_S
        # What it gives a drive is for a computer that has time for both of them.
        made.TIMEOUT_SWITCH_OP_MODE = made.TIMEOUT_SWITCH_STATE_FINAL = made.TIMEOUT_CHECK_TPDO = ANSWER_S
        yield made
        network.sync.stop()
        network.disconnect()


def wait_for(done: Callable[[], bool]) -> None:
    give_up_s = time.monotonic() + 2.0 * ANSWER_S
    while not done():
        assert time.monotonic() < give_up_s, "it never came"
        time.sleep(0.01)


def test_it_goes_through_the_states_by_process_data(node: BaseNode402) -> None:
    node.nmt.state = "PRE-OPERATIONAL"
    wait_for(lambda: node.sdo[0x1000].raw & 0xFFFF == 402)
    node.setup_402_state_machine()
    node.nmt.state = "OPERATIONAL"
    node.network.sync.start(0.01)
    node.op_mode = "PROFILED VELOCITY"
    assert node.op_mode == "PROFILED VELOCITY"
    for state in ("READY TO SWITCH ON", "SWITCHED ON", "OPERATION ENABLED", "SWITCH ON DISABLED"):
        node.state = state
        wait_for(lambda state=state: node.state == state)
    node.sdo[0x2001].raw = 0x7305
    wait_for(lambda: bool(node.is_faulted()))
    assert node.emcy.log[-1].code == 0x7305
