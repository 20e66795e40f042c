"""The blocks of a program in order, with a look at the lines that come next."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

from controller.program.program import Block, TipLine

AHEAD_LINES = 2000  # that a choice of branch looks at


def _frame(block: TipLine) -> tuple[object, ...]:
    """What says where the words of a line lead."""
    return block.modal.tip, block.modal.offset, block.modal.part


class Ahead:
    """An iterator over blocks; what it is asked to look at it keeps until it is taken."""

    def __init__(self, blocks: Iterator[Block]) -> None:
        self._blocks = blocks
        self._seen: deque[Block] = deque()

    def __iter__(self) -> Iterator[Block]:
        return self

    def __next__(self) -> Block:
        return self._seen.popleft() if self._seen else next(self._blocks)

    def lines_like(self, block: TipLine) -> list[TipLine]:
        """The feed lines with tool vectors that follow ``block`` in its frame, as far as a choice looks."""
        found: list[TipLine] = []
        for after in self._upcoming():
            if not isinstance(after, TipLine) or after.feed_mm_s is None:
                break
            if _frame(after) != _frame(block):
                break
            found.append(after)
            if len(found) >= AHEAD_LINES:
                break
        return found

    def _upcoming(self) -> Iterator[Block]:
        yield from tuple(self._seen)
        for block in self._blocks:
            self._seen.append(block)
            yield block
