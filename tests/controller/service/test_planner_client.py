"""The pipe between the service and its plan."""

from __future__ import annotations

import os
import socket
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from multiprocessing.connection import Connection

import pytest
from support.machines.stepped_runs import shipped

from controller.ipc.control_socket import CommandRefused
from controller.runtime.plan_messages import Answer, News, Program
from controller.service.planner_client import Line

WAIT_S = 20.0
ENDS = 300
LARGE = 8 << 20  # bytes: more than any pipe holds


class Ends:
    """The service's end, and a plan's that reads when it is told to."""

    def __init__(self) -> None:
        own, its = socket.socketpair()
        self.fails = False
        self.line, self.plan = Line(own, self._hear), Connection(its.detach())
        self.others = ThreadPoolExecutor(2)

    def _hear(self, _: News) -> None:
        if self.fails:
            raise KeyError("of ours")


@pytest.fixture
def ends() -> Iterator[Ends]:
    made = Ends()
    yield made
    made.plan.close()
    made.line.close()
    made.others.shutdown()


def test_a_stop_while_a_large_program_is_on_its_way_waits_for_nothing_and_breaks_nothing(ends: Ends) -> None:
    program = Program(bytes(LARGE), "large.ngc", shipped())
    ordered = ends.others.submit(ends.line.order, "check", program=program)
    assert ends.plan.poll(WAIT_S), "the beginning is there"
    ends.others.submit(ends.line.give_up).result(WAIT_S)
    order, given_up = ends.plan.recv(), ends.plan.recv()
    assert (order.verb, given_up.verb) == ("check", "give up")
    assert order.program.text == program.text
    ends.plan.send(Answer(order.number, {"blocks": 1}))
    assert ordered.result(WAIT_S) == {"blocks": 1}


def test_whoever_waits_for_a_plan_that_ends_is_told(ends: Ends) -> None:
    ordered = ends.others.submit(ends.line.order, "arm")
    assert ends.plan.poll(WAIT_S)
    ends.plan.close()
    with pytest.raises(CommandRefused, match="planner is gone"):
        ordered.result(WAIT_S)
    with pytest.raises(CommandRefused, match="planner is gone"):
        ends.line.order("arm")


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_an_error_of_ours_over_news_leaves_nobody_waiting_and_ends_the_plan(ends: Ends) -> None:
    ordered = ends.others.submit(ends.line.order, "arm")
    assert ends.plan.poll(WAIT_S) and ends.plan.recv().verb == "arm"
    ends.fails = True
    ends.plan.send(News())
    with pytest.raises(CommandRefused, match="planner is gone"):
        ordered.result(WAIT_S)
    with pytest.raises(EOFError):
        ends.plan.recv()
    ends.line._listener.join(WAIT_S)


def test_a_plan_that_ends_while_its_line_is_closed_takes_no_descriptor_of_anybody_else() -> None:
    """Two threads that close one descriptor each close another one's: whoever has its number by then."""
    interval_s = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(1) as plans:
            for _ in range(ENDS):
                own, its = socket.socketpair()
                line = Line(own, lambda _: None)
                ended = plans.submit(its.close)
                line.close()
                opened = os.pipe()
                line._listener.join(WAIT_S)
                assert not line._listener.is_alive(), "it waits at a descriptor that was closed under it"
                ended.result(WAIT_S)
                for one in opened:
                    os.close(one)  # raises where it is not ours any more
    finally:
        sys.setswitchinterval(interval_s)
