"""The device's state machine: every state against every command."""

from __future__ import annotations

from support.suite.cases import each

from drives.bench.simulated.machine402 import TRANSITIONS, Command, Power, command, following


def test_the_way_up_and_down_takes_three_steps_each() -> None:
    state, seen = Power.DISABLED, []
    for word in (0x06, 0x07, 0x0F, 0x07, 0x06, 0x00):
        asked = command(word, 0)
        assert asked is not None
        state = following(state, asked) or state
        seen.append(state)
    up = [Power.READY, Power.SWITCHED_ON, Power.ENABLED]
    assert seen == [*up, Power.SWITCHED_ON, Power.READY, Power.DISABLED]


@each("state", list(Power))
@each("asked", list(Command))
def test_no_command_leads_up_by_more_than_one_step_or_out_of_a_fault_without_reset(
    state: Power, asked: Command
) -> None:
    ladder = [Power.DISABLED, Power.READY, Power.SWITCHED_ON, Power.ENABLED]
    after = following(state, asked)
    if after is not None and state in ladder and after in ladder:
        assert ladder.index(after) <= ladder.index(state) + 1
    if state in (Power.FAULT, Power.FAULT_REACTION) and asked is not Command.RESET:
        assert after is None
    assert asked is not Command.RESET or state is Power.FAULT or after is None


def test_reset_counts_on_its_rising_edge_only() -> None:
    assert command(0x80, 0x00) is Command.RESET
    assert command(0x80, 0x80) is None


def test_every_state_but_the_first_can_be_left() -> None:
    left = {state for state, _ in TRANSITIONS}
    assert left == set(Power) - {Power.NOT_READY, Power.FAULT_REACTION}
