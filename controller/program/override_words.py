"""M48 to M53: what the program takes from the operator's hand, and gives back.

M48 and M49 are for the overrides of feeds and of the spindle. The override of rapids, hold and stop stay
with the operator.
"""

from __future__ import annotations

from dataclasses import replace

from controller.machine.model import Machine
from controller.program.codes import Ask
from controller.program.program import Modal

FEED_STOP = "feed_stop"  # the input of M53


def applied(ask: Ask, modal: Modal, machine: Machine) -> Modal:
    """The modal state after the line's code of the group. Raises ProgramError."""
    code, word = ask.codes["overrides"]
    if code in ("M48", "M49"):
        return replace(modal, overrides=modal.overrides._replace(feed=code == "M48"))
    on = _on(ask, code)
    if code == "M50":
        return replace(modal, overrides=modal.overrides._replace(feed=on))
    if code == "M52" and on:
        raise ask.refusal(word, "override.adaptive")
    if code == "M53":
        _check_input(ask, machine, on)
        return replace(modal, overrides=modal.overrides._replace(stop=on))
    return modal


def _on(ask: Ask, code: str) -> bool:
    """P: 0 is off, 1 or nothing on."""
    p = ask.words.get("P")
    if p is not None and p.value not in (0.0, 1.0):
        raise ask.refusal(p, "override.on_or_off", code=code)
    return p is None or p.value == 1.0


def _check_input(ask: Ask, machine: Machine, on: bool) -> None:
    if on and (machine.io is None or machine.io.input(FEED_STOP) is None):
        raise ask.refusal(ask.codes["overrides"][1], "override.no_feed_stop", input=FEED_STOP)
