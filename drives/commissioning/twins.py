"""Two drives with one node id: both answer every request, both take every setting and every setpoint.

Nobody notices as long as they agree. What tells them apart is that one request has two
answers, and as a rule two serial numbers (1018h:04). An answer that was sent twice, or one
that comes late, is none: it does not happen again.
"""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct

from drives import pdo
from drives.commissioning.network import SDO_REQUEST, Network
from drives.texts import Message, chain, message

IDENTITY, SERIAL = 0x1018, 4
FIRST_S = 0.15  # for all first answers
SECOND_S = 0.05  # for the second of any of them
ROUNDS = 2  # in which every twin must have answered
UPLOAD, EXPEDITED, COMMAND_MASK = 0x40, 0x43, 0xE3
REQUEST = Struct("<BHB4x")
ASKED = REQUEST.pack(UPLOAD, IDENTITY, SERIAL)

Serials = tuple[int | None, ...]  # of all that answered, as they came; None = it does not tell


def doubled(network: Network, nodes: Sequence[int]) -> dict[int, Serials]:
    """Node ids that more than one drive has, with the serial numbers told. Raises CommissionError."""
    suspects = list(nodes)
    found: dict[int, Serials] = {}
    for _ in range(ROUNDS):
        answers = _serials_by_node(network, suspects)
        found = {node: serials for node, serials in answers.items() if len(serials) > 1}
        suspects = sorted(found)
        if not suspects:
            break
    return found


def sentence(serials: Serials) -> Message:
    """What is wrong and what to do, after the name of the drive."""
    known = [f"{serial:#x}" for serial in serials if serial is not None]
    if not known:
        return message("drive.twins", count=len(serials))
    return message("drive.twins_known", count=len(serials), serials=chain("and", known))


def _serials_by_node(network: Network, nodes: Sequence[int]) -> dict[int, Serials]:
    """The serial numbers that every node answers to one request."""
    answers: dict[int, Serials] = {}

    def hear(can_id: int, data: bytes) -> None:
        if pdo.group(can_id) == pdo.SDO_ANSWER and data[1:4] == ASKED[1:4]:
            node = can_id & pdo.NODE_MASK
            answers[node] = (*answers.get(node, ()), _serial(data))

    network.receive()  # what was asked before is none of it
    before, network.hearer = network.hearer, hear
    try:
        for node in nodes:
            network.post(SDO_REQUEST + node, ASKED)
            network.receive()
        network.wait(lambda: answers.keys() >= set(nodes), FIRST_S)
        network.wait(lambda: False, SECOND_S)
    finally:
        network.hearer = before
    return {node: answers[node] for node in nodes if node in answers}


def _serial(data: bytes) -> int | None:
    told = data[0] & COMMAND_MASK == EXPEDITED
    return int.from_bytes(data[4:8], "little") if told else None
