"""A serial line without hardware: a machine's end as a pseudo terminal, for tests."""

from __future__ import annotations

import contextlib
import errno
import os
import select
import threading
import time
import tty


class Pty:
    """A machine's end of a serial line, and the path of ours."""

    def __init__(self) -> None:
        self.machine, ours = os.openpty()
        tty.setraw(self.machine)
        os.set_blocking(self.machine, False)
        self.ended = threading.Event()  # nobody reads any more
        self.path = os.ttyname(ours)
        self._ours = ours  # stays open, as a port stays there without anybody using it

    def write(self, data: bytes) -> None:
        """Send; when it returns our end has got it, so a sender that was stopped by it is stopped."""
        while data and not self.ended.is_set():
            if select.select([], [self.machine], [], 0.1)[1]:
                with contextlib.suppress(BlockingIOError):
                    data = data[os.write(self.machine, data) :]
        select.select([self._ours], [], [], 0.0)  # whoever looks makes the kernel deliver what it holds

    def read(self, wait_s: float = 0.2) -> bytes:
        if not select.select([self.machine], [], [], wait_s)[0]:
            return b""
        try:
            return os.read(self.machine, 65536)
        except OSError as error:
            if error.errno != errno.EIO:
                raise
            return b""

    def drained(self) -> None:
        """Wait until our end's reader has taken all of it."""
        while not self.ended.is_set() and select.select([self._ours], [], [], 0.0)[0]:
            time.sleep(0.001)

    def cut(self) -> None:
        if self.machine >= 0:
            os.close(self.machine)
            self.machine = -1

    def close(self) -> None:
        self.cut()
        os.close(self._ours)
