"""Layer setting services (CiA 305): a node id for a drive that has none, or another one.

A drive is singled out by its identity (1018h: vendor, product, revision, serial number). Where
the serial number is not known, ``fastscan`` finds a drive without a node id by halving the
range of every identity word: drives answer yes or nothing.

    waiting --- selective, or fastscan ---> configuration --- switch global ---> waiting
"""

from __future__ import annotations

from struct import Struct

from drives import pdo
from drives.commissioning.identity import named
from drives.commissioning.network import CommissionError, Network
from drives.texts import Message, chain, message

REQUEST, ANSWER = 0x7E5, pdo.LSS_ANSWER
SWITCH_GLOBAL, SET_NODE, STORE = 0x04, 0x11, 0x17
SELECT, SELECTED, IDENTIFIED = 0x40, 0x44, 0x4F
WITHOUT_ID, IS_WITHOUT_ID = 0x4C, 0x50
FASTSCAN, RESET_SCAN = 0x51, 0x80
INQUIRE, INQUIRE_NODE = 0x5A, 0x5E
UNCONFIGURED = 255
WAITING, CONFIGURATION = 0, 1
RESET_COMMUNICATION, PRE_OPERATIONAL, ALL_NODES = 0x82, 0x80, 0
ANSWER_TIMEOUT_S = 0.02  # CiA 305 names no time; drives answer within a few milliseconds
BOOT_S = 5.0
FRAME = Struct("<BI3x")
SCAN = Struct("<BIBBB")

Identity = tuple[int, int, int, int]


class Lss:
    """The master's side on one bus. Everybody on it must be without torque: they are put pre-operational."""

    def __init__(self, network: Network, answer_s: float = ANSWER_TIMEOUT_S) -> None:
        self._network = network
        self._answer_s = answer_s
        self._answers: list[bytes] = []

    def assign(self, node: int, identity: Identity | None, store: bool) -> Identity:
        """Give the drive of this identity, or the only one without a node id, its ``node``.

        Gives its identity. ``store``: it keeps the id. Raises CommissionError.
        """
        self._network.hearer = self._hear
        try:
            self._network.send_message(0, bytes([PRE_OPERATIONAL, ALL_NODES]))
            self._switch(WAITING)
            found = self._single_out(identity)
            before = self._present_node()
            self._set(SET_NODE, node, message("lss.giving", node=node))
            self._switch(WAITING)
            self._boot(before, node)
            if identity is None and self._ask(bytes([WITHOUT_ID])):
                raise CommissionError(message("lss.several", node=node))
            if store:
                self._store(found)
            return found
        finally:
            self._switch(WAITING)
            self._network.hearer = None

    def _hear(self, can_id: int, data: bytes) -> None:
        if can_id == ANSWER:
            self._answers.append(data)

    def _ask(self, data: bytes, of_many: bool = False) -> bytes:
        """The answer, or nothing. Where many may answer, the last of them must not be taken for the next."""
        self._answers.clear()
        self._network.post(REQUEST, data.ljust(8, b"\0"))
        self._network.wait(lambda: bool(self._answers) and not of_many, self._answer_s)
        return self._answers[0] if self._answers else b""

    def _tell(self, data: bytes) -> None:
        self._network.post(REQUEST, data.ljust(8, b"\0"))

    def _switch(self, state: int) -> None:
        self._tell(bytes([SWITCH_GLOBAL, state]))

    def _single_out(self, identity: Identity | None) -> Identity:
        found = self.scan() if identity is None else identity
        if found is None:
            raise CommissionError(message("lss.nobody"))
        if identity is not None and not self._select(identity):
            words = [
                message("identity.word", **named(sub), word=word) for sub, word in enumerate(identity, 1)
            ]
            raise CommissionError(message("lss.not_found", words=chain("comma", words)))
        return found

    def _select(self, identity: Identity) -> bool:
        for place, word in enumerate(identity[:3]):
            self._tell(FRAME.pack(SELECT + place, word))
        return self._ask(FRAME.pack(SELECT + 3, identity[3]))[:1] == bytes([SELECTED])

    def scan(self) -> Identity | None:
        """The identity of a drive without a node id, which is then in configuration; None: there is none."""
        if not self._scanned(0, RESET_SCAN, 0, 0):
            return None
        words = []
        for place in range(4):
            word = 0
            for bit in range(31, -1, -1):
                if not self._scanned(word, bit, place, place):
                    word |= 1 << bit
            if not self._scanned(word, 0, place, (place + 1) % 4):
                return None
            words.append(word)
        return words[0], words[1], words[2], words[3]

    def _scanned(self, word: int, bit: int, place: int, following: int) -> bool:
        request = SCAN.pack(FASTSCAN, word, bit, place, following)
        return self._ask(request, of_many=True)[:1] == bytes([IDENTIFIED])

    def _present_node(self) -> int:
        answer = self._ask(bytes([INQUIRE_NODE]))
        return answer[1] if answer[:1] == bytes([INQUIRE_NODE]) else UNCONFIGURED

    def _set(self, command: int, value: int, what: Message) -> None:
        answer = self._ask(bytes([command, value]))
        if answer[:1] != bytes([command]) or answer[1]:
            why = message("lss.error", code=answer[1]) if answer else message("lss.silent")
            raise CommissionError(message("lss.refused", what=what, why=why))

    def _boot(self, before: int, node: int) -> None:
        """A drive that had an id takes the new one with its next reset of communication."""
        heard: list[int] = []

        def hear(can_id: int, data: bytes) -> None:
            if can_id == 0x700 + node and data[:1] == b"\0":
                heard.append(node)
            self._hear(can_id, data)

        self._network.hearer = hear
        if before != UNCONFIGURED:
            self._network.send_message(0, bytes([RESET_COMMUNICATION, before]))
        booted = self._network.wait(lambda: bool(heard), BOOT_S)
        self._network.hearer = self._hear
        if not booted:
            raise CommissionError(message("lss.no_boot_up", node=node))

    def _store(self, identity: Identity) -> None:
        if not self._select(identity):
            raise CommissionError(message("lss.gone"))
        self._set(STORE, 0, message("lss.storing"))
