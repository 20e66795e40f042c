"""Whatever the tick's queue refuses has a reason, and every reason a sentence that says what to do."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from support.machines.path_bench import T, along_x, even, follower, loaded, message, piece_of, plan, steps
from support.machines.tick_bench import Bench
from typer.testing import CliRunner

from controller import __main__ as command_line
from controller.ipc.handoff import PieceMessage, dwell
from controller.messages import LANGUAGES, text
from controller.runtime import checked
from controller.state.modes import Mode, Request
from controller.state.queue_refusals import QueueRefusal, refusal_message
from controller.tick.follow import Follow


def running() -> Follow:
    follow = loaded(plan(1.0))
    steps(follow, 10)
    return follow


# Of each reason that the queue itself has: a queue, and what it is sent.
SENT: dict[QueueRefusal, tuple[Callable[[], Follow], Callable[[Follow], PieceMessage]]] = {
    QueueRefusal.EPOCH: (running, lambda f: replace(message(f, [dwell(1.0)]), epoch=7)),
    QueueRefusal.EMPTY: (running, lambda f: message(f, [])),
    QueueRefusal.LATE: (running, lambda f: message(f, [dwell(1.0)], at_s=f.commit_s - T)),
    QueueRefusal.GAP: (running, lambda f: message(f, [dwell(1.0)], at_s=f.queue_end_s + T)),
    QueueRefusal.UNKNOWN_MOTION: (running, lambda f: message(f, [piece_of(even(0.0, 1.0), 9)])),
    QueueRefusal.ELSEWHERE: (follower, lambda f: message(f, [piece_of(even(5.0, 1.0))], {0: along_x()})),
    QueueRefusal.JUMP: (running, lambda f: message(f, [piece_of(even(0.0, 1.0))], at_s=f.commit_s)),
}


@pytest.mark.parametrize("why", SENT)
def test_the_queue_says_why_it_takes_a_message_not(why: QueueRefusal) -> None:
    follow, sent = SENT[why][0](), SENT[why][1]
    before = follow.queue_end_s
    assert not follow.accept(sent(follow)) and follow.queue_end_s == before
    assert follow.refusal is why


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("why", QueueRefusal)
def test_every_reason_has_a_whole_sentence_of_its_own(why: QueueRefusal, language: str) -> None:
    words = text(refusal_message(why), language)
    assert words[0].isupper() and words.endswith(".") and "{" not in words and len(words) > 30
    assert words not in {text(refusal_message(other), language) for other in QueueRefusal if other is not why}


def test_what_the_machine_and_the_number_of_a_message_forbid_has_its_reason_too() -> None:
    bench = Bench()

    def refusal(of: int | None = None) -> QueueRefusal:
        if of is not None:
            bench.sequence = of
        bench.send([dwell(1.0)], {})
        bench.tick()
        return bench.snapshot.refusal

    assert refusal() is QueueRefusal.MODE and bench.snapshot.mode is Mode.OFF
    bench.enable()
    assert refusal() is QueueRefusal.NONE
    assert refusal(of=bench.sequence - 1) is QueueRefusal.OLD
    bench.ask(Request.STOP)
    assert refusal() is QueueRefusal.VOID
    bench.close()


def test_a_run_in_which_nothing_moves_is_no_success_and_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its path is laid from beside the axes, as it once was after homing by a switch."""
    part = tmp_path / "part.ngc"
    part.write_text("G0 X10\nM30\n")

    def beside(asked: checked.Task, walk: checked.Walk, joints: tuple[float, ...], _: bool) -> checked.Walk:
        return checked.path_of(replace(asked, start=(joints[0] + 0.016, *joints[1:])))

    monkeypatch.setattr(checked, "walk_from", beside)
    done = CliRunner().invoke(command_line.app, ["simulate", str(part), "--store", str(tmp_path), "--json"])
    answer = json.loads(done.stdout)
    assert (done.exit_code, answer["ok"], answer["result"]) == (1, False, "stuck")
    assert text(refusal_message(QueueRefusal.ELSEWHERE)) in answer["error"]
