"""``directrix simulate`` as it is, and the processor seconds of its parts into a file: MARKS, then its words.

Nothing is imported for it that the command does not import, nor in another order: both would be its time.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from types import ModuleType
from typing import Any

from controller import __main__ as command_line

PARTS_S: dict[str, float] = {}
MARKS = sys.argv.pop(1)
before_s = 0.0


def ends(part: str) -> None:
    global before_s
    now_s = time.process_time()
    PARTS_S[part] = PARTS_S.get(part, 0.0) + now_s - before_s
    before_s = now_s


def ends_before(
    owner: Any, name: str, began: Callable[[], None], done: Callable[[], None] | None = None
) -> None:
    """Has ``began`` called before a function of ``owner`` and ``done`` after it."""
    inner = getattr(owner, name)

    def watched(*arguments: Any, **named: Any) -> Any:
        began()
        result = inner(*arguments, **named)
        if done is not None:
            done()
        return result

    setattr(owner, name, watched)


def started() -> None:
    """The machine file is about to be read; all is imported."""
    stepped = sys.modules["controller.runtime.stepped"].SteppedMachine
    ends("start")
    ends_before(stepped, "__init__", lambda: ends("plan"))
    ends_before(stepped, "run", lambda: ends("come up"), lambda: ends("ticks"))


def imported(name: str, inner: Callable[[str], ModuleType] = command_line._imported) -> ModuleType:
    module = inner(name)
    ends_before(module, "_machine", started)
    return module


command_line._imported = imported
try:
    command_line.main()
except SystemExit as ended:
    ends("trace")
    with open(MARKS, "w") as file:
        json.dump(PARTS_S, file)
    command_line.leave(ended.code)
