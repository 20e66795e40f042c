"""Where a machine is brought up: the machine, who stands at it, and what is known of it already."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol as Interface

from controller.bringup.protocol import Protocol
from controller.bringup.ticks import Bench
from controller.machine.model import Axis
from controller.messages import Message


class Operator(Interface):
    """Who stands at the machine."""

    def value(self, question: Message) -> float:
        """What he has read off. Raises NotDone where he says nothing."""

    def confirms(self, question: Message) -> bool:
        """Whether he has seen it."""

    def does(self, request: Message) -> None:
        """Asks him to do something by hand, and waits until he has. Raises NotDone where he does not."""

    def works(self, request: Message) -> contextlib.AbstractContextManager[Callable[[], bool]]:
        """Asks him for something that the control watches for meanwhile: whether he says it will not come."""


@dataclass(frozen=True, slots=True)
class Site:
    """The machine, who stands at it, what was found before, and the program of the dry run."""

    bench: Bench
    operator: Operator
    protocol: Protocol
    part: Path | None = None

    def index(self, axis: str) -> int:
        return [one.name for one in self.bench.machine.axes].index(axis)

    def axis(self, name: str) -> Axis:
        return self.bench.machine.axes[self.index(name)]

    def by_hand(self, action: str, request: Message) -> None:
        if not self.bench.by_hand(action):
            self.operator.does(request)

    @contextlib.contextmanager
    def watched(self, action: str, request: Message) -> Iterator[Callable[[], bool]]:
        """While it is looked whether something comes that is done by hand: whether it is given up."""
        if self.bench.by_hand(action):
            yield lambda: False
        else:
            with self.operator.works(request) as gives_up:
                yield gives_up
