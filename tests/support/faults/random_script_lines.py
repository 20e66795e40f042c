"""One line of a random fault script: what goes wrong, with whom, for how long."""

from __future__ import annotations

import random
from collections.abc import Callable

from controller.machine.model import Axis, Machine


def line(rng: random.Random, machine: Machine) -> tuple[str, float]:
    """One fault as "on BUS: |words", and about how long it lasts, s."""
    axis, bus = rng.choice(machine.axes), rng.choice(machine.buses).name
    kind = rng.choice((*KINDS, *AT_DRIVES))
    if kind in AT_DRIVES:
        words, length_s = AT_DRIVES[kind](rng, axis)
        return f"|{kind} {words}", length_s
    words, on_bus, length_s = KINDS[kind](rng, axis.name, machine.period_s)
    return f"{f'on {bus}: ' if on_bus else ''}|{kind} {words}", length_s


Hardware = Callable[[random.Random, Axis], tuple[str, float]]
Words = tuple[str, bool, float]  # the words, whether they are about a whole bus, and how long it lasts


def _frames(rng: random.Random, axis: str) -> tuple[str, bool]:
    name = rng.choice(("rpdo", "rpdo", "rpdo", "tpdo", "tpdo", "sync", "heartbeat"))
    return (name, True) if name == "sync" else (f"{name} {axis}", False)


def _how_many(rng: random.Random, period_s: float) -> tuple[str, float]:
    """So many frames, or so long, now and then by chance."""
    if rng.random() < 0.5:
        count = rng.choice((1, 2, 3, 5, 10, 20, 50, 200, 1000))
        return f"x {count}", count * period_s
    length_s = rng.choice((0.002, 0.01, 0.05, 0.2, 1.0, 10.0))
    return f"for {length_s} s" + (
        f" odds {rng.choice((0.2, 0.5, 0.9))}" if rng.random() < 0.3 else ""
    ), length_s


def _befall(rng: random.Random, axis: str, period_s: float) -> Words:
    (target, on_bus), (many, length_s) = _frames(rng, axis), _how_many(rng, period_s)
    return f"{target} {many}", on_bus, length_s


def _late(rng: random.Random, axis: str, period_s: float) -> Words:
    target, on_bus, length_s = _befall(rng, axis, period_s)
    name, _, rest = target.partition(" x ")
    late_ms = rng.choice((0.3, 1.0, 3.0, 10.0, 40.0, 150.0))
    if rest:
        return f"{name} x {rest} by {late_ms} ms", on_bus, length_s + 1e-3 * late_ms
    name, _, rest = target.partition(" for ")
    return f"{name} by {late_ms} ms for {rest}", on_bus, length_s + 1e-3 * late_ms


def _falsify(rng: random.Random, axis: str, period_s: float) -> Words:
    many, length_s = _how_many(rng, period_s)
    name, byte = rng.choice(("rpdo", "tpdo")), rng.randrange(6)
    return f"{name} {axis} byte {byte} xor {1 << rng.randrange(8):02X} {many}", False, length_s


def _node(rng: random.Random, axis: str, _: float) -> Words:
    length_s = rng.choice((0.005, 0.05, 0.3, 1.0))
    return f"{axis} for {length_s} s", False, length_s


def _bus_off(rng: random.Random, axis: str, period_s: float) -> Words:
    words, _, length_s = _node(rng, axis, period_s)
    return (words, False, length_s) if rng.random() < 0.7 else (f"master for {length_s} s", True, length_s)


def _whole_bus(what: str) -> Callable[[random.Random, str, float], Words]:
    def words(rng: random.Random, _axis: str, _period_s: float) -> Words:
        length_s = rng.choice((0.005, 0.02, 0.1, 0.4))
        return f"{what} for {length_s} s", True, length_s

    return words


KINDS: dict[str, Callable[[random.Random, str, float], Words]] = {
    "drop": _befall,
    "delay": _late,
    "duplicate": _befall,
    "reorder": _befall,
    "repeat": _befall,
    "corrupt": _befall,
    "falsify": _falsify,
    "silence": _node,
    "bus_off": _bus_off,
    "node_reset": lambda _rng, axis, _period_s: (axis, False, 0.3),
    "queue_full": _whole_bus("master"),
    "babble": _whole_bus("001"),
}


# ---- what befalls the drive itself, and what a stranger does


def _lasts(rng: random.Random) -> tuple[str, float]:
    """For a while, now and then for good."""
    if rng.random() < 0.15:
        return "", 1.0
    length_s = rng.choice((0.005, 0.02, 0.05, 0.1, 0.3, 1.0))
    return f" for {length_s} s", length_s


def _hardware(
    what: Callable[[random.Random, Axis], str],
) -> Callable[[random.Random, Axis], tuple[str, float]]:
    def words(rng: random.Random, axis: Axis) -> tuple[str, float]:
        how_long, length_s = _lasts(rng)
        return f"{axis.name}{what(rng, axis)}{how_long}", length_s

    return words


def _somewhere(rng: random.Random, axis: Axis) -> str:
    """A switch where the programs go, in counts."""
    return f" at {round(rng.uniform(-60.0, 120.0) / axis.shown_per_unit * axis.counts_per_unit)}"


def _forged(rng: random.Random, axis: Axis) -> tuple[str, float]:
    name = rng.choice(("rpdo", "rpdo", "tpdo", "heartbeat", "emcy"))
    data = rng.choice(("", " data 0F0000000000", " data 0B0000000000", " data 0600", " data 00", " data 7F"))
    # As long as a stranger goes on the drive obeys him, too, and nothing can be promised.
    return f"{name} {axis.name}{data} x {rng.choice((1, 2, 5, 20, 50))}", 0.05


AT_DRIVES: dict[str, Hardware] = {
    "jam": _hardware(lambda _rng, _axis: ""),
    "weak": _hardware(lambda rng, _axis: f" to {rng.choice((1, 2, 5, 10, 30, 80))} %"),
    "sto": _hardware(lambda _rng, _axis: ""),
    "power": _hardware(lambda _rng, _axis: ""),
    "limit": _hardware(_somewhere),
    "switch": _hardware(lambda rng, _axis: f" {rng.choice(('high', 'low'))}"),
    "mode": lambda rng, axis: (f"{axis.name} to {rng.choice((0, 1, 3, 4, 6, 7, 8, 9, 10))}", 0.3),
    "nmt": lambda rng, axis: (
        f"{axis.name} {rng.choice(('start', 'stop', 'preop', 'reset', 'reset_communication'))}",
        0.3,
    ),
    "foreign": _forged,
    "second": lambda _rng, axis: (axis.name, 0.5),
}
