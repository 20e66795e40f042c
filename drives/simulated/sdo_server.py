"""The SDO server of a simulated drive: expedited and segmented transfers (CiA 301, 7.2.4).

``answer`` takes the eight bytes of a request and gives those of the answer, or None
where the protocol has none (an abort by the client). Block transfer is refused with
its abort code, as the standard allows.
"""

from __future__ import annotations

import struct

from drives.simulated.dictionary import Abort, Code, Dictionary

HEAD = struct.Struct("<BHB")
ABORT = struct.Struct("<BHBI")


class SdoServer:
    """State of the one transfer that may be under way."""

    def __init__(self, dictionary: Dictionary) -> None:
        self._dictionary = dictionary
        self._where = (0, 0)
        self._toggle = 0
        self._upload: bytes | None = None  # what is left to send
        self._download: bytearray | None = None  # what has come so far
        self._announced = 0  # bytes the client promised; 0 = it did not say

    def answer(self, request: bytes) -> bytes | None:
        """One step of the dialogue."""
        command = request[0] >> 5
        try:
            if command == 4:
                self._forget()
                return None
            if command == 0:
                return self._take_segment(request)
            if command == 3:
                return self._give_segment(request)
            _, *self._where = HEAD.unpack_from(request)  # type: ignore[assignment]
            if command == 1:
                return self._start_download(request)
            if command == 2:
                return self._start_upload()
            raise Abort(Code.COMMAND)
        except Abort as abort:
            self._forget()
            return ABORT.pack(0x80, *self._where, abort.code)

    def _forget(self) -> None:
        self._upload = self._download = None
        self._toggle = 0

    def _start_upload(self) -> bytes:
        self._forget()
        data = self._dictionary.read(*self._where)
        if len(data) <= 4:
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
            self._forget()
        return bytes([toggle | (7 - len(part)) << 1 | last]) + part.ljust(7, b"\0")

    def _start_download(self, request: bytes) -> bytes:
        self._forget()
        expedited, sized = request[0] & 2, request[0] & 1
        if expedited:
            length = 4 - (request[0] >> 2 & 3) if sized else self._natural_length()
            self._dictionary.write(*self._where, bytes(request[4 : 4 + length]))
        else:
            self._download = bytearray()
            self._announced = int.from_bytes(request[4:8], "little") if sized else 0
        return HEAD.pack(0x60, *self._where) + bytes(4)

    def _natural_length(self) -> int:
        """An expedited download without a size fills the object."""
        variable = self._dictionary.variables.get(self._where[0] << 8 | self._where[1])
        return variable.size if variable is not None and variable.size else 4

    def _take_segment(self, request: bytes) -> bytes:
        if self._download is None:
            raise Abort(Code.COMMAND)
        toggle = self._expect_toggle(request[0])
        self._download += request[1 : 8 - (request[0] >> 1 & 7)]
        if request[0] & 1:
            data = bytes(self._download)
            if self._announced and len(data) != self._announced:
                raise Abort(Code.TOO_LONG if len(data) > self._announced else Code.TOO_SHORT)
            self._forget()
            self._dictionary.write(*self._where, data)
        return bytes([0x20 | toggle]).ljust(8, b"\0")

    def _expect_toggle(self, command: int) -> int:
        toggle = command & 0x10
        if toggle != self._toggle:
            raise Abort(Code.TOGGLE)
        self._toggle ^= 0x10
        return toggle
