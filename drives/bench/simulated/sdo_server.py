"""The SDO server of a simulated drive: expedited, segmented and block transfers (CiA 301, 7.2.4).

``answer`` takes the eight bytes of a request and gives those of every answer to it:
none to an abort or to a segment inside of a block, many to a block upload.
"""

from __future__ import annotations

import struct
from binascii import crc_hqx
from collections.abc import Callable

from drives.bench.simulated.dictionary import MEMORY_BYTES, Abort, Code, Dictionary

HEAD = struct.Struct("<BHB")
ABORT = struct.Struct("<BHBI")
ABORT_COMMAND = 4
# Client command specifiers (bits 7 .. 5 of the first byte).
SEGMENT_DOWN, DOWN, UP, SEGMENT_UP, BLOCK_UP, BLOCK_DOWN = 0, 1, 2, 3, 5, 6
START, END, START_UPLOAD = 0, 1, 3  # client sub-commands of block transfers


LAST = 0x80
LONGEST_BLOCK = 127


def checksum(data: bytes) -> int:
    """CRC of block transfers: x^16 + x^12 + x^5 + 1, start value 0."""
    return crc_hqx(data, 0)


class BlockUpload:
    """The server's side of a block upload.

        client A4 ---> C6 size; A3 ---> 01 .. nn segments; A2 ackseq ---> next block or C1 crc; A1

    A segment carries seven bytes after its number (1 .. 127), bit 7 set on the very last one. Who receives
    confirms the last number that came in order; the sender goes on after it.
    """

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
    """The server's side of a block download.

    client C6 ---> A4 blksize; 01 .. nn segments ---> A2 ackseq blksize; C1 crc ---> A1
    """

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


class SdoServer:
    """State of the one transfer that may be under way."""

    def __init__(self, dictionary: Dictionary) -> None:
        self._dictionary = dictionary
        self._where = (0, 0)
        self._toggle = 0
        self._upload: bytes | None = None  # what is left to send
        self._download: bytearray | None = None  # what has come so far
        self._announced = 0  # bytes the client promised; 0 = it did not say
        self._block_up: BlockUpload | None = None
        self._block_down: BlockDownload | None = None
        self._steps: dict[int, Callable[[bytes], bytes]] = {
            SEGMENT_DOWN: self._take_segment,
            DOWN: self._start_download,
            UP: self._start_upload,
            SEGMENT_UP: self._give_segment,
        }

    @property
    def busy(self) -> bool:
        """A transfer of several frames is under way: the client owes the next one."""
        transfers = (self._upload, self._download, self._block_up, self._block_down)
        return any(transfer is not None for transfer in transfers)

    @property
    def writing(self) -> bool:
        """A download is under way; nothing has been written yet."""
        return self._download is not None or self._block_down is not None

    def answer(self, request: bytes) -> list[bytes]:
        """One step of the dialogue."""
        try:
            if self._block_down is not None and self._block_down.receiving:
                return self._inside_block(request, self._block_down)
            return self._step(request)
        except Abort as abort:
            return [self._abort(abort.code)]

    def give_up(self) -> bytes:
        """The client did not go on in time: the abort frame (05040000h)."""
        return self._abort(Code.TIMEOUT)

    def forget(self) -> None:
        """End whatever is under way, silently."""
        self._upload = self._download = None
        self._block_up = self._block_down = None
        self._toggle = 0

    def _abort(self, code: Code) -> bytes:
        self.forget()
        return ABORT.pack(0x80, *self._where, code)

    def _step(self, request: bytes) -> list[bytes]:
        command = request[0] >> 5
        if command == ABORT_COMMAND:
            self.forget()
            return []
        if command == BLOCK_UP:
            return self._block_upload(request)
        if command == BLOCK_DOWN:
            return self._block_download(request)
        if command not in (SEGMENT_DOWN, SEGMENT_UP):
            self._begin(request)
        if command not in self._steps:
            raise Abort(Code.COMMAND)
        return [self._steps[command](request)]

    def _begin(self, request: bytes) -> None:
        self.forget()
        _, index, sub = HEAD.unpack_from(request)
        self._where = (index, sub)

    # -- expedited and segmented

    def _start_upload(self, _request: bytes) -> bytes:
        data = self._dictionary.read(*self._where)
        if 0 < len(data) <= 4:
            # expedited, size indicated, n = bytes without data
            return HEAD.pack(0x43 | (4 - len(data)) << 2, *self._where) + data.ljust(4, b"\0")
        self._upload = data
        return HEAD.pack(0x41, *self._where) + len(data).to_bytes(4, "little")

    def _give_segment(self, request: bytes) -> bytes:
        if self._upload is None:
            raise Abort(Code.COMMAND)
        toggle = self._expect_toggle(request[0])
        part, self._upload = self._upload[:7], self._upload[7:]
        last = not self._upload
        if last:
            self.forget()
        return bytes([toggle | (7 - len(part)) << 1 | last]) + part.ljust(7, b"\0")

    def _start_download(self, request: bytes) -> bytes:
        expedited, sized = request[0] & 2, request[0] & 1
        if expedited:
            length = 4 - (request[0] >> 2 & 3) if sized else self._natural_length()
            self._dictionary.write(*self._where, bytes(request[4 : 4 + length]))
        else:
            self._expect_room(int.from_bytes(request[4:8], "little") if sized else 0)
            self._download = bytearray()
        return HEAD.pack(0x60, *self._where) + bytes(4)

    def _expect_room(self, announced: int) -> None:
        """Refuse at once what must not or cannot be written."""
        self._dictionary.writable(*self._where)
        if announced > MEMORY_BYTES:
            raise Abort(Code.MEMORY)
        self._announced = announced

    def _natural_length(self) -> int:
        """An expedited download without a size fills the object."""
        variable = self._dictionary.variables.get(self._where[0] << 8 | self._where[1])
        return variable.size if variable is not None and variable.size else 4

    def _take_segment(self, request: bytes) -> bytes:
        if self._download is None:
            raise Abort(Code.COMMAND)
        toggle = self._expect_toggle(request[0])
        self._download += request[1 : 8 - (request[0] >> 1 & 7)]
        if len(self._download) > MEMORY_BYTES:
            raise Abort(Code.MEMORY)
        if request[0] & 1:
            self._finish_download(bytes(self._download))
        return bytes([0x20 | toggle]).ljust(8, b"\0")

    def _finish_download(self, data: bytes) -> None:
        if self._announced and len(data) != self._announced:
            raise Abort(Code.LENGTH)
        self.forget()
        self._dictionary.write(*self._where, data)

    def _expect_toggle(self, command: int) -> int:
        toggle = command & 0x10
        if toggle != self._toggle:
            raise Abort(Code.TOGGLE)
        self._toggle ^= 0x10
        return toggle

    # -- block transfer

    def _block_upload(self, request: bytes) -> list[bytes]:
        if request[0] & 3 == START:
            return [self._start_block_upload(request)]
        if self._block_up is None:
            raise Abort(Code.COMMAND)
        if request[0] & 3 == END:
            if not self._block_up.ended:
                raise Abort(Code.COMMAND)
            self.forget()
            return []
        if request[0] & 3 == START_UPLOAD:
            return self._block_up.start()
        return self._block_up.acknowledged(request[1], request[2])

    def _start_block_upload(self, request: bytes) -> bytes:
        """With a threshold (pst) that the object does not exceed, the server changes to segments."""
        self._begin(request)
        data = self._dictionary.read(*self._where)
        threshold = request[5]
        if threshold and len(data) <= threshold:
            return self._start_upload(request)
        self._block_up = BlockUpload(data, request[4], bool(request[0] & 4))
        return HEAD.pack(0xC6, *self._where) + len(data).to_bytes(4, "little")

    def _block_download(self, request: bytes) -> list[bytes]:
        if request[0] & 1 == START:
            self._begin(request)
            self._expect_room(int.from_bytes(request[4:8], "little") if request[0] & 2 else 0)
            self._block_down = BlockDownload(bool(request[0] & 4))
            return [HEAD.pack(0xA4, *self._where) + bytes([self._block_down.size, 0, 0, 0])]
        if self._block_down is None:
            raise Abort(Code.COMMAND)
        self._finish_download(self._block_down.end(request[0] >> 2 & 7, request[1] | request[2] << 8))
        return [bytes([0xA1]).ljust(8, b"\0")]

    def _inside_block(self, request: bytes, block: BlockDownload) -> list[bytes]:
        """Every byte pattern but an abort is a segment now."""
        if request[0] == 0x80:
            self.forget()
            return []
        return block.take(request)
