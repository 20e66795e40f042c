"""The blocks of a check on their way to the reader: written as they come, the longest kept for the table."""

from __future__ import annotations

import heapq
import json
import tempfile
from typing import IO, Any, TextIO

from controller.plan.report.survey import BlockUse

MAX_ROWS = 40  # of the table; JSON has all
IN_MEMORY = 1 << 20  # bytes of JSON before they go to a file
CHUNK = 1 << 16


class Rows:
    """Takes blocks one by one; memory does not grow with their number."""

    def __init__(self) -> None:
        self.count = 0
        self.left_out = 0  # that move, but not as long as the longest
        self._longest: list[tuple[float, int, BlockUse]] = []
        self._text: IO[str] = tempfile.SpooledTemporaryFile(IN_MEMORY, "w+", encoding="utf-8")  # noqa: SIM115

    def take(self, block: BlockUse) -> None:
        """The next block."""
        self._text.write(("," if self.count else "") + json.dumps(block.to_dict()))
        self.count += 1
        took_s = sum(part.time_s for part in (block.own, block.approach, block.departure) if part)
        if took_s == 0.0:
            return
        row = (took_s, -self.count, block)
        if len(self._longest) < MAX_ROWS:
            heapq.heappush(self._longest, row)
        else:
            heapq.heappushpop(self._longest, row)
            self.left_out += 1

    @property
    def longest(self) -> list[BlockUse]:
        """The blocks that take longest, in the order of the program."""
        return [block for _, _, block in sorted(self._longest, key=lambda row: -row[1])]

    def write(self, facts: dict[str, Any], out: TextIO) -> None:
        """One JSON object on one line: the facts, and all blocks as ``blocks``."""
        out.write(json.dumps(facts)[:-1] + ', "blocks": [')
        self._text.seek(0)
        while chunk := self._text.read(CHUNK):
            out.write(chunk)
        out.write("]}\n")
