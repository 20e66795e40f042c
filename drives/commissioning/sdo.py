"""The client's side of SDO (CiA 301, 7.2.4): expedited and segmented transfers, one at a time."""

from __future__ import annotations

from collections.abc import Callable
from struct import Struct
from typing import Final

UPLOAD, UPLOAD_SEGMENT, DOWNLOAD, DOWNLOAD_SEGMENT = 0x40, 0x60, 0x20, 0x00
UPLOADED, SEGMENT_UPLOADED, DOWNLOADED, SEGMENT_DOWNLOADED = 0x40, 0x00, 0x60, 0x20
COMMAND, EXPEDITED, SIZED, TOGGLE, LAST = 0xE0, 0x02, 0x01, 0x10, 0x01
ABORT: Final = 0x80
TIMED_OUT, TOGGLE_ERROR, UNKNOWN_COMMAND = 0x0504_0000, 0x0503_0000, 0x0504_0001
SEGMENT_BYTES, EXPEDITED_BYTES = 7, 4

_HEAD: Final = Struct("<BHB")
_SIZED: Final = Struct("<BHBI")
_ABORTED: Final = Struct("<4xI")

# CiA 301, 7.2.4.3.17: what an abort code says.
SAID = {
    0x0503_0000: "the toggle bit was not alternated",
    0x0504_0000: "the transfer has timed out",
    0x0504_0001: "the command is unknown",
    0x0504_0002: "the block size is invalid",
    0x0504_0003: "the sequence number is invalid",
    0x0504_0004: "the check sum is wrong",
    0x0504_0005: "out of memory",
    0x0601_0000: "such an access is not supported",
    0x0601_0001: "the object is write only",
    0x0601_0002: "the object is read only",
    0x0602_0000: "there is no such object",
    0x0604_0041: "the object cannot be mapped into a PDO",
    0x0604_0042: "the PDO would be too long",
    0x0604_0043: "the parameter does not go with others",
    0x0604_0047: "something inside of the device does not go with it",
    0x0606_0000: "a hardware error",
    0x0607_0010: "the length is not that of the data type",
    0x0607_0012: "too long for the data type",
    0x0607_0013: "too short for the data type",
    0x0609_0011: "there is no such sub-index",
    0x0609_0030: "the value is out of range",
    0x0609_0031: "the value is too high",
    0x0609_0032: "the value is too low",
    0x0609_0036: "the maximum is below the minimum",
    0x060A_0023: "a resource is not available",
    0x0800_0000: "a general error",
    0x0800_0020: "the data cannot be transferred or stored",
    0x0800_0021: "the data cannot be stored: local control",
    0x0800_0022: "the data cannot be stored in the present state",
    0x0800_0023: "there is no object dictionary",
    0x0800_0024: "there is no data",
}


class AbortedError(Exception):
    """The server has ended the transfer with an abort code."""

    def __init__(self, code: int) -> None:
        said = SAID.get(code)
        super().__init__(f"code 0x{code:08X}{f', {said}' if said else ''}")
        self.code = code


class SilentError(Exception):
    """No answer, or one that is none to what was asked."""


class Client:
    """Transfers with one server; ``ask`` sends a request and gives its answer, b"" = none has come."""

    def __init__(self, ask: Callable[[bytes], bytes]) -> None:
        self._ask = ask

    def upload(self, index: int, sub: int, size: int = 0) -> bytes:
        """An object's bytes; at most ``size`` of them, 0 = all. Raises AbortedError, SilentError."""
        answer = self._answered(_SIZED.pack(UPLOAD, index, sub, 0), UPLOADED)
        command, of_index, of_sub = _HEAD.unpack_from(answer)
        if (of_index, of_sub) != (index, sub):
            raise SilentError(f"the answer is of object {of_index:04X}h:{of_sub:02X}")
        if not command & EXPEDITED:
            data = self._segments()
        elif command & SIZED:
            data = answer[4 : 8 - (command >> 2 & 3)]
        else:
            data = answer[4:8]
        return data[:size] if size else data  # some drives send four bytes of whatever they have

    def _segments(self) -> bytes:
        data, toggle, last = bytearray(), 0, 0
        while not last:
            answer = self._answered(bytes([UPLOAD_SEGMENT | toggle]).ljust(8, b"\0"), SEGMENT_UPLOADED)
            self._see_alternated(answer, toggle)
            data += answer[1 : 8 - (answer[0] >> 1 & 7)]
            toggle, last = toggle ^ TOGGLE, answer[0] & LAST
        return bytes(data)

    def download(self, index: int, sub: int, data: bytes, segmented: bool = False) -> None:
        """Write an object; ``segmented`` however short it is. Raises AbortedError, SilentError."""
        if data and len(data) <= EXPEDITED_BYTES and not segmented:
            command = DOWNLOAD | EXPEDITED | SIZED | (EXPEDITED_BYTES - len(data)) << 2
            self._answered(_HEAD.pack(command, index, sub) + data.ljust(EXPEDITED_BYTES, b"\0"), DOWNLOADED)
            return
        self._answered(_SIZED.pack(DOWNLOAD | SIZED, index, sub, len(data)), DOWNLOADED)
        toggle = 0
        for at in range(0, len(data) or 1, SEGMENT_BYTES):
            part = data[at : at + SEGMENT_BYTES]
            last = at + SEGMENT_BYTES >= len(data)
            command = DOWNLOAD_SEGMENT | toggle | (SEGMENT_BYTES - len(part)) << 1 | last
            answer = self._answered(bytes([command]) + part.ljust(SEGMENT_BYTES, b"\0"), SEGMENT_DOWNLOADED)
            self._see_alternated(answer, toggle)
            toggle ^= TOGGLE

    def _answered(self, request: bytes, wanted: int) -> bytes:
        answer = self._ask(request)
        if not answer:
            self._give_up(TIMED_OUT)
            raise SilentError("no answer")
        answer = answer.ljust(8, b"\0")  # eight bytes by the standard, less from some drives
        if answer[0] == ABORT:
            raise AbortedError(_ABORTED.unpack(answer)[0])
        if answer[0] & COMMAND != wanted:
            self._give_up(UNKNOWN_COMMAND)
            raise SilentError(f"the answer has the command {answer[0]:#04x}")
        return answer

    def _see_alternated(self, answer: bytes, toggle: int) -> None:
        if answer[0] & TOGGLE != toggle:
            self._give_up(TOGGLE_ERROR)
            raise SilentError("the toggle bit was not alternated")

    def _give_up(self, code: int) -> None:
        self._ask(_SIZED.pack(ABORT, 0, 0, code))
