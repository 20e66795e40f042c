"""Looking, without changing anything: who is on the bus, how they are, what is in them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from struct import Struct

from drives import cia402, pdo
from drives.commissioning import twins
from drives.commissioning.network import SDO_REQUEST, CommissionError, Network, Node
from drives.commissioning.remote import Drive
from drives.texts import Message

NODES = range(1, 128)
ANSWER_TIMEOUT_S = 0.15  # for a whole bus of drives that answer SDO within some milliseconds
ROUNDS = 3  # a gateway or adapter may swallow what comes before it has settled
UPLOAD, ABORT = 0x40, 0x80
REQUEST = Struct("<BHB4x")
WORD = Struct("<I")
NMT_NAMES = {0: "boot-up", 4: "stopped", 5: "operational", 127: "pre-operational"}
MODE_NAMES = {0: "-", 1: "pp", 3: "pv", 4: "tq", 6: "hm", 7: "ip", 8: "csp", 9: "csv", 10: "cst"}


@dataclass(frozen=True, slots=True)
class Found:
    """A node that answers; None = it does not tell."""

    node: int
    device_type: int | None
    vendor: int | None
    product: int | None
    revision: int | None
    serial: int | None
    twins: twins.Serials = ()  # serial numbers where more than one drive has this node id

    @property
    def profile(self) -> int | None:
        """Number of the device profile: 402 a drive, 401 inputs and outputs."""
        return None if self.device_type is None else self.device_type & 0xFFFF


class _Questions:
    """Expedited uploads of one object from many nodes at once."""

    def __init__(self, network: Network) -> None:
        self._network = network
        self._answers: dict[int, bytes] = {}

    def ask(self, nodes: Sequence[int], index: int, sub: int) -> dict[int, int | None]:
        """By node that answers: the value, None where it was refused. Raises CommissionError."""
        self._answers.clear()
        self._network.hearer = self._hear
        try:
            for _ in range(ROUNDS):
                for node in nodes:
                    if node not in self._answers:
                        self._network.post(SDO_REQUEST + node, REQUEST.pack(UPLOAD, index, sub))
                        self._network.receive()
                self._network.wait(lambda: len(self._answers) == len(nodes), ANSWER_TIMEOUT_S)
        finally:
            self._network.hearer = None
        return {node: _value(data) for node, data in sorted(self._answers.items())}

    def _hear(self, can_id: int, data: bytes) -> None:
        if pdo.group(can_id) == pdo.SDO_ANSWER and len(data) == 8:
            self._answers[can_id & pdo.NODE_MASK] = data


def _value(data: bytes) -> int | None:
    if data[0] & 0xE3 != 0x43:  # anything but an expedited answer with its size
        return None
    unused = data[0] >> 2 & 0x3
    return int.from_bytes(data[4 : 8 - unused], "little")


def scan(network: Network) -> list[Found]:
    """Every node that answers to SDO, with its identity (1000h, 1018h). Raises CommissionError."""
    questions = _Questions(network)
    kinds = questions.ask(NODES, 0x1000, 0)
    nodes = list(kinds)
    words = [questions.ask(nodes, 0x1018, sub) if nodes else {} for sub in range(1, 5)]
    doubled = twins.doubled(network, nodes) if nodes else {}
    return [_found(node, kinds[node], [word.get(node) for word in words], doubled) for node in nodes]


def _found(
    node: int, kind: int | None, words: Sequence[int | None], doubled: Mapping[int, twins.Serials]
) -> Found:
    vendor, product, revision, serial = words
    return Found(node, kind, vendor, product, revision, serial, doubled.get(node, ()))


@dataclass(frozen=True, slots=True)
class Status:
    """How a node is; None = it has no such object."""

    name: str
    node: int
    nmt: str  # as its heartbeat says; "unknown" without one
    state: str | None  # of the power stage, from the statusword
    statusword: int | None
    mode: int | None
    position_counts: int | None
    error_code: int | None  # 603Fh
    error_register: int | None  # 1001h
    history: tuple[int, ...]  # 1003h, newest first

    @property
    def mode_name(self) -> str:
        return "-" if self.mode is None else MODE_NAMES.get(self.mode, str(self.mode))


def status(network: Network, nodes: Sequence[Node], listen_s: float = 0.15) -> list[Status]:
    """How every node is; heartbeats are listened for first. Raises CommissionError."""
    expected = {node.node for node in nodes}
    network.wait(lambda: expected <= network.nmt_states.keys(), listen_s)
    return [_status(network, node) for node in nodes]


def _status(network: Network, node: Node) -> Status:
    drive = Drive(network, node)
    drive.read(0x1000)  # whoever is silent is named here
    word = _optional(drive, 0x6041)
    return Status(
        name=node.name,
        node=node.node,
        nmt=NMT_NAMES.get(network.nmt_states.get(node.node, -1), "unknown"),
        state=None if word is None else cia402.state(word).name.lower().replace("_", " "),
        statusword=word,
        mode=_optional(drive, 0x6061),
        position_counts=_optional(drive, 0x6064),
        error_code=_optional(drive, 0x603F),
        error_register=_optional(drive, 0x1001),
        history=tuple(_history(drive)),
    )


def _optional(drive: Drive, index: int, sub: int = 0) -> int | None:
    if not drive.has(index, sub):
        return None
    try:
        return drive.read(index, sub)
    except CommissionError:
        return None


def _history(drive: Drive) -> Iterator[int]:
    count = _optional(drive, 0x1003) or 0
    for sub in range(1, min(count, 8) + 1):
        word = _optional(drive, 0x1003, sub)
        if word is not None:
            yield word


@dataclass(frozen=True, slots=True)
class Entry:
    """One object of a drive as it is now."""

    index: int
    sub: int
    name: str
    access: str
    value: int | float | str | None
    default: int | None  # by the data sheet
    refused: Message | None  # why there is no value; None: there is one


def dump(network: Network, node: Node) -> Iterator[Entry]:
    """Every object of the data sheet that can be read. Raises CommissionError where nobody answers."""
    drive = Drive(network, node)
    drive.read(0x1000)
    for index in sorted(drive.sheet.dictionary.indices):
        if index < 0x1000:  # data types
            continue
        subs = [0, *drive.sheet.subs(index)]
        for sub in subs:
            found = drive.sheet.find(index, sub)
            if found is not None and found.readable:
                value, refused = _shown_value(drive, index, sub)
                default = drive.sheet.default(index, sub)
                yield Entry(index, sub, found.qualname, found.access_type, value, default, refused)


def _shown_value(drive: Drive, index: int, sub: int) -> tuple[int | float | str | None, Message | None]:
    try:
        value = drive.raw(index, sub)
    except CommissionError as error:
        return None, error.said
    return (value.hex(" ") if isinstance(value, bytes) else value), None
