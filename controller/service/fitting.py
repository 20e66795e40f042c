"""Offsets and tools as the door has them: set at the machine, and given back to the machine file."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from controller.ipc.control_socket import CommandRefused, Values
from controller.ipc.handoff import Snapshot
from controller.machine import setup_data
from controller.machine.changes import plain_offset
from controller.machine.model import Machine
from controller.machine.toml_table import ConfigError
from controller.messages import Key
from controller.service import touch_off
from controller.service.refusals import refused, whole
from controller.service.service import Service
from controller.state.modes import Mode

# Of a tool whose length is touched off: that, and what every row of the table has.
LENGTHENED = ("name", "radius_mm", "flute_mm", "length_mm", "wear_length_mm")
AT_REST = (Mode.OFF, Mode.READY, Mode.FAULT)


def set_offset(service: Service, args: Values) -> Values:
    """By ``values``, or such that axes read what ``reads`` says, with ``tool`` if not with the one in the
    spindle. Raises CommandRefused.
    """
    name, values, reads = str(args.get("name", "")), args.get("values"), args.get("reads")
    by = whole(args, "tool")

    def touched() -> Values:
        machine, now = service.set_up.machine, _place(service)
        other = by if by != service.set_up.tool else None
        found = touch_off.offset(machine, service.run.in_force(now), now.joints, name, reads, other)
        return plain_offset(machine, found)

    change = partial(setup_data.with_offset, name=name)
    return _fit(service, "offsets", name, (lambda: values) if reads is None else touched, change)


def set_tool(service: Service, args: Values) -> Values:
    """Make, change or (``remove``) take out a tool; its length also such that an axis reads what ``reads``
    says. Raises CommandRefused.
    """
    values = dict(args)
    number, remove, reads = values.pop("number", None), values.pop("remove", False), values.pop("reads", None)
    if not isinstance(number, int) or isinstance(number, bool):
        raise refused("not_whole", code="bad", name="number", value=number)

    def made() -> Values | None:
        """The whole row as it is kept: what is not said of a tool stays, also after the next start."""
        if remove:
            return None
        before = service.set_up.fitted.get("tools", {}).get(str(number)) or {}
        if reads is None:
            return {**before, **values}
        now = _place(service)
        found = touch_off.tool(service.set_up.machine, service.run.in_force(now), now.joints, number, reads)
        return {**before, **{name: getattr(found, name) for name in LENGTHENED}}

    return _fit(service, "tools", str(number), made, partial(setup_data.with_tool, number=number))


def _place(service: Service) -> Snapshot:
    """Where the tool stands. Raises CommandRefused where nobody knows."""
    now = service.processes.now()
    touch_off.check_homed(service.set_up.machine, now)
    return now


def forget(service: Service, values: Values) -> Values:
    """What was set at the machine, or by a program, is the machine file's again. Raises CommandRefused."""
    name = str(values["name"])
    what = "tools" if name.startswith("T") else "offsets"
    with at_rest(service, what, "FORGET"):
        try:
            left = setup_data.without(service.set_up.fitted, name)
        except KeyError:
            raise refused("not_set_here", code="bad", name=name) from None
        service.set_up.fit(service.set_up.applied(left), left)
    return service.set_up.to_json()


@contextlib.contextmanager
def at_rest(service: Service, what: str, request: str) -> Iterator[None]:
    """At rest only: a program under way was planned with what was fitted when it began.

    But a tool that was led off the path of a held program may be changed for another. Raises CommandRefused.
    """
    with service.set_up.lock:  # one change at a time, and no start in the middle of one
        now = service.engine.snapshot()
        if now is not None and not _may_fit(service, what, now):
            key = "not_fitted_yet" if now.mode in AT_REST else "not_fitted"
            raise refused(key, now.mode.name, request, what=Key(what))
        try:
            yield
        except ConfigError as error:
            raise CommandRefused("bad", error.said) from error


def _fit(
    service: Service, what: str, key: str, made: Callable[[], Any], change: Callable[..., Machine]
) -> Values:
    """One value of the store, as it is made then, which counts instead of the machine file's."""
    set_up = service.set_up
    with at_rest(service, what, f"SET {what.upper()}"):
        values = made()
        machine = change(set_up.machine, values=values)
        rotary = setup_data.rotary_deg(machine, key) if what == "offsets" else {}
        if rotary:  # though it was not said
            values = {**(values if isinstance(values, dict) else {"origin_mm": values}), **rotary}
        fitted = set_up.fitted
        set_up.fit(machine, {**fitted, what: {**fitted.get(what, {}), key: values}})
    return set_up.to_json()


def _may_fit(service: Service, what: str, now: Snapshot) -> bool:
    if what == "tools" and service.run.aside and now.mode is Mode.HOLD:
        return service.sequencer.busy != "return"  # which is planned with those that are fitted
    return now.mode in AT_REST and service.run.job is None
