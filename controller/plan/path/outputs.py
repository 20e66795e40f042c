"""What the program says of outputs (M62, M63) and overrides (M48 to M53) while it moves.

Each stretch has what was said up to its block.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import replace

from controller.machine.model import Machine
from controller.motion.motions import ThreadMove
from controller.plan.path.probing import NAME
from controller.plan.stretch import Chain, Pause, Stretch
from controller.program.program import ENABLED, UNSAID, Block, Outputs, Overrides

_Said = tuple[Outputs, Overrides, bool]
_NOTHING: _Said = (UNSAID, ENABLED, False)


class Switched:
    """Notes the blocks as they are read, and hands on what is made of them."""

    def __init__(self, machine: Machine) -> None:
        self._probe = machine.probe.tool if machine.probe is not None else None
        self._said = deque[tuple[int, _Said]]([(0, _NOTHING)])  # from which order on

    def read(self, blocks: Iterable[Block]) -> Iterator[Block]:
        for block in blocks:
            modal = block.modal
            said = modal.outputs, modal.overrides, modal.tool == self._probe
            if said != self._said[-1][1]:
                self._said.append((block.place.order, said))
            yield block

    def laid(self, items: Iterable[Chain | Pause]) -> Iterator[Chain | Pause]:
        """The same path; the stretches come in the order of their blocks."""
        for item in items:
            if isinstance(item, Chain) and (
                len(self._said) > 1 or self._said[0][1] != _NOTHING or _tied(item)
            ):
                item = replace(item, stretches=tuple(self._switching(one) for one in item.stretches))
            yield item

    def _switching(self, stretch: Stretch) -> Stretch:
        while len(self._said) > 1 and self._said[1][0] <= stretch.place.order:
            self._said.popleft()
        outputs, overrides, guarded = self._said[0][1]
        if stretch.name == NAME:
            overrides, guarded = overrides._replace(feed=False), False
        if isinstance(stretch.motion, ThreadMove):  # its feed is the spindle's
            overrides = overrides._replace(feed=False)
        return replace(stretch, outputs=outputs, overrides=overrides, guarded=guarded)


def _tied(chain: Chain) -> bool:
    return any(isinstance(stretch.motion, ThreadMove) for stretch in chain.stretches)
