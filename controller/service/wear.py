"""Tool life and maintenance as the door has them: changed by their verbs, and asked before a start."""

from __future__ import annotations

from typing import Any

from controller.ipc.control_socket import Values
from controller.service.refusals import number, refused, whole
from controller.service.usage import Usage

MAX_TOOL = 100_000
LONGEST_MIN, MAX_PARTS, LONGEST = 1e6, 1_000_000, 1e9
LONGEST_NAME = 60


def check(usage: Usage, tool: int, program: str) -> None:
    """Raises CommandRefused "worn" where the tool in the spindle is."""
    if told := usage.worn(tool):
        raise refused("worn", "READY", "START", "worn", program=program, **told)


def tool_life(usage: Usage, args: Values) -> Values:
    """Limits of a tool; null: none. Raises CommandRefused."""
    tool = _tool(args)
    cut = None if args.get("cut_min") is None else number(args, "cut_min", 0.1, LONGEST_MIN)
    parts = None if args.get("parts") is None else int(number(args, "parts", 1, MAX_PARTS))
    usage.set_life(tool, cut, parts)
    return _kept(usage)


def tool_renewed(usage: Usage, args: Values) -> Values:
    """Raises CommandRefused."""
    usage.renew(_tool(args))
    return _kept(usage)


def maintenance(usage: Usage, args: Values) -> Values:
    """Make, change or (without an interval) take out a job of maintenance. Raises CommandRefused."""
    name = _name(args)
    if args.get("every") is None:
        usage.remove_item(name)
    else:
        usage.set_item(name, str(args.get("counter", "")), number(args, "every", 0.001, LONGEST))
    return _kept(usage)


def maintained(usage: Usage, args: Values) -> Values:
    """Raises CommandRefused."""
    usage.done(_name(args), str(args.get("by", ""))[:LONGEST_NAME])
    return _kept(usage)


def _kept(usage: Usage) -> dict[str, Any]:
    """What was said is on the disk before it is answered. Raises CommandRefused."""
    try:
        usage.save(at_once=True)
    except OSError as error:
        raise refused("not_written", code="busy", path=usage.file, why=error.strerror) from error
    return usage.told()


def _tool(args: Values) -> int:
    if not (found := whole(args, "tool", MAX_TOOL)):
        raise refused("not_whole", code="bad", name="tool", value=args.get("tool"))
    return found


def _name(args: Values) -> str:
    name = args.get("name")
    if not isinstance(name, str) or not name.strip() or len(name) > LONGEST_NAME or not name.isprintable():
        raise refused("no_item_name", code="bad", most=LONGEST_NAME)
    return name.strip()
