"""SDO block transfers (CiA 301, 7.2.4.2.9 - 7.2.4.2.14): the two sides that send segments.

    upload    client A4 ---> C6 size; A3 ---> 01 .. nn segments; A2 ackseq ---> next block or C1 crc; A1
    download  client C6 ---> A4 blksize; 01 .. nn segments ---> A2 ackseq blksize; C1 crc ---> A1

A segment carries seven bytes behind its number (1 .. 127), bit 7 set on the very last
one. Who receives confirms the last number that came in order; the sender goes on
behind it, so a lost segment costs a repetition and not the transfer.
"""

from __future__ import annotations

from binascii import crc_hqx

from drives.bench.simulated.aborts import Abort, Code
from drives.bench.simulated.dictionary import MEMORY_BYTES

LAST = 0x80
LONGEST_BLOCK = 127


def checksum(data: bytes) -> int:
    """CRC of block transfers: x^16 + x^12 + x^5 + 1, start value 0."""
    return crc_hqx(data, 0)


class BlockUpload:
    """The server's side of a block upload."""

    def __init__(self, data: bytes, size: int, with_crc: bool) -> None:
        self._data = data
        self._confirmed = 0  # bytes
        self._sent = 0  # segments of the running block
        self._crc = checksum(data) if with_crc else 0
        self.ended = False
        self._size = 0
        self._resize(size)

    def _resize(self, size: int) -> None:
        if not 1 <= size <= LONGEST_BLOCK:
            raise Abort(Code.BLOCK_SIZE)
        self._size = size

    def start(self) -> list[bytes]:
        return self._block()

    def acknowledged(self, sequence: int, next_size: int) -> list[bytes]:
        """The client has the block up to ``sequence``; what it has not is sent again."""
        if sequence > self._sent:
            raise Abort(Code.SEQUENCE)
        self._resize(next_size)
        self._confirmed = min(len(self._data), self._confirmed + 7 * sequence)
        if self._confirmed < len(self._data) or (not self._data and not sequence):
            return self._block()
        self.ended = True
        unused = -len(self._data) % 7 if self._data else 7
        return [bytes([0xC1 | unused << 2, self._crc & 0xFF, self._crc >> 8]).ljust(8, b"\0")]

    def _block(self) -> list[bytes]:
        frames = []
        for sequence in range(1, self._size + 1):
            at = self._confirmed + 7 * (sequence - 1)
            last = at + 7 >= len(self._data)
            part = self._data[at : at + 7].ljust(7, b"\0")
            frames.append(bytes([sequence | (LAST if last else 0)]) + part)
            if last:
                break
        self._sent = len(frames)
        return frames


class BlockDownload:
    """The server's side of a block download."""

    def __init__(self, with_crc: bool, size: int = LONGEST_BLOCK) -> None:
        self.size = size
        self.receiving = True  # segments, until the last one is confirmed
        self._with_crc = with_crc
        self._data = bytearray()
        self._in_order = 0  # number of the last segment that came in order
        self._complete = False

    def take(self, segment: bytes) -> list[bytes]:
        """A segment; at the end of the block the answer says how far it was in order."""
        sequence = segment[0] & 0x7F
        if sequence == 0 or sequence > self.size:
            raise Abort(Code.SEQUENCE)
        if sequence == self._in_order + 1 and not self._complete:
            self._data += segment[1:8]
            self._in_order = sequence
            self._complete = bool(segment[0] & LAST)
        if len(self._data) > MEMORY_BYTES + 7:
            raise Abort(Code.MEMORY)
        if sequence < self.size and not segment[0] & LAST:
            return []
        confirmed, self._in_order = self._in_order, 0
        self.receiving = not self._complete
        return [bytes([0xA2, confirmed, self.size]).ljust(8, b"\0")]

    def end(self, unused: int, crc: int) -> bytes:
        """All data, ``unused`` bytes of the last segment cut off. Raises Abort for a wrong checksum."""
        if not self._complete:
            raise Abort(Code.COMMAND)
        data = bytes(self._data[: len(self._data) - unused])
        if self._with_crc and crc != checksum(data):
            raise Abort(Code.CRC)
        return data
