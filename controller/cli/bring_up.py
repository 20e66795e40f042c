"""``directrix bring-up``: a new machine step by step, and what came of each step in a protocol."""

from __future__ import annotations

import contextlib
import json
import math
import select
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from controller import messages, own_files
from controller.cli import remote
from controller.cli.client import Url
from controller.machine import machine_file
from controller.machine.model import Machine
from controller.messages import Message, message
from controller.verify import console
from controller.verify.console import Misunderstood, agreed, in_words, refusals, show, spoken, tell

if TYPE_CHECKING:
    from controller.bringup.protocol import Protocol
    from controller.bringup.steps import Step
    from controller.bringup.ticks import Bench

EVERY = "all"  # in place of a step's name


def bring_up(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER")],
    machine: str = "trunnion",
    simulate: bool = False,
    step: Annotated[list[str] | None, typer.Option("--step", metavar="STEP")] = None,
    again: bool = False,
    yes: Annotated[list[str] | None, typer.Option("--yes", metavar="STEP")] = None,
    value: Annotated[list[str] | None, typer.Option("--value", metavar="STEP=VALUE")] = None,
    skip: Annotated[list[str] | None, typer.Option("--skip", metavar="STEP=REASON")] = None,
    part: Annotated[Path | None, typer.Option("--part", metavar="PROGRAM")] = None,
    list_only: Annotated[bool, typer.Option("--list")] = False,
    take_over: bool = False,
    url: Url = remote.URL,
    as_json: bool = False,
) -> None:
    """Bring a new machine up, step by step: what moves, what to look at, and what came of it in a protocol.

    It can be left after any step and gone on with; nothing moves without being asked. Exit code 1 where a
    step is not as it should be, or could not be ended.
    """
    from controller.bringup import protocol as protocols
    from controller.bringup import report
    from controller.bringup import steps as declared

    with refusals(as_json):
        made = machine_file.load(machine)
        steps = declared.steps(made)
        skipped = _skipped(skip or [], steps)
        answers = Answers(_named(yes or [], steps), _values(value or [], steps), as_json)
        chosen = _named(step or [EVERY], steps)
        own_files.make_folder(folder)
        protocol = protocols.opened(folder, made, simulate)
        for name, reason in skipped.items():
            protocol.skip(name, reason)
        todo = [one for one in steps if one.name in chosen and (again or one.name not in protocol.done)]
        with contextlib.ExitStack() as ending:
            opener = (
                partial(_bench, made, url, take_over, ending) if not simulate else partial(_simulated, made)
            )
            run = Session(made, protocol, steps, answers, part, opener)
            if not list_only:
                run.work(todo)
        report.write(protocol, steps)
        _tell(run, as_json)
    if run.failed:
        raise typer.Exit(1)


def _simulated(machine: Machine) -> Bench:
    from controller.bringup.simulated import SimulatedBench

    return SimulatedBench(machine)


def _bench(machine: Machine, url: str, take_over: bool, ending: contextlib.ExitStack) -> Bench:
    """The machine behind a panel, controlled until the end. Raises Refused."""
    from controller.cli.live_bench import LiveBench

    found = ending.enter_context(remote.connected(url, remote.known_token()))
    bench = LiveBench(found, machine)
    ending.enter_context(found.control(take_over))
    return bench


@dataclass(frozen=True, slots=True)
class Answers:
    """What the command line has said already: steps that are agreed to, and values by step."""

    yes: frozenset[str]
    values: Mapping[str, float]
    silent: bool  # nobody is asked for more


@dataclass
class Session:
    """The steps that are worked through now; the machine is there from the first that needs it."""

    machine: Machine
    protocol: Protocol
    steps: Sequence[Step]
    answers: Answers
    part: Path | None
    open: Callable[[], Bench]
    unfinished: dict[str, Message] = field(default_factory=dict)  # step: why it was not ended
    bad: list[str] = field(default_factory=list)
    _bench: Bench | None = None

    @property
    def failed(self) -> bool:
        return bool(self.bad or self.unfinished)

    @property
    def bench(self) -> Bench:
        """Raises what a machine that does not come up raises."""
        if self._bench is None:
            self._bench = self.open()
        return self._bench

    def work(self, todo: Sequence[Step]) -> None:
        """One step after another, each written down as it ends; a fault that stays ends it."""
        from controller.bringup import report

        for step in todo:
            if not self._begins(step):
                continue
            self._conduct(step)
            report.write(self.protocol, self.steps)
            if step.name in self.unfinished and self.bench.stopped_by() is not None:
                return

    def _begins(self, step: Step) -> bool:
        """Shows what is to be done, and asks."""
        if not self.answers.silent:
            for which in ("title", "do", "look"):
                show.print(in_words(step.text(which)), soft_wrap=True)
        if step.name in self.answers.yes:
            return True
        key = "bringup.ask.moves" if step.moves else "bringup.ask.step"
        return not self.answers.silent and agreed(console.say(key, step=step.name))

    def _conduct(self, step: Step) -> None:
        from controller.bringup.conduct import carry_out
        from controller.bringup.protocol import BAD
        from controller.bringup.site import Site

        operator = AtTerminal(step.name, self.answers)
        why = carry_out(step, Site(self.bench, operator, self.protocol, self.part))
        if why is not None:
            self.unfinished[step.name] = why
            tell.print(in_words(why))
            return
        done = self.protocol.done[step.name]
        self.bad += [step.name] if done["verdict"] == BAD else []
        if not self.answers.silent:
            for one in (*done["figures"], *done["findings"]):
                show.print(f"  {in_words(one)}", soft_wrap=True)


class AtTerminal:
    """The operator of one step, asked where the command line has not said it already."""

    def __init__(self, step: str, answers: Answers) -> None:
        self._step, self._answers = step, answers

    def value(self, question: Message) -> float:
        from controller.bringup.ticks import NotDone

        if self._step in self._answers.values:
            return self._answers.values[self._step]
        if self._answers.silent:
            raise NotDone(message("bringup.no_value", step=self._step))
        while True:
            typed = self._typed(question, message("bringup.no_value", step=self._step))
            try:
                return _finite(typed)
            except ValueError:
                tell.print(console.say("bringup.no_answer", found=typed))

    def confirms(self, question: Message) -> bool:
        if self._step in self._answers.yes:
            return True
        return not self._answers.silent and agreed(in_words(question))

    def does(self, request: Message) -> None:
        self._typed(request, message("bringup.nobody"), default="", show_default=False)

    @staticmethod
    def _typed(question: Message, missing: Message, **how: Any) -> str:
        """Raises NotDone(missing) where the input has ended, and typer.Abort at Ctrl-C."""
        from controller.bringup.ticks import NotDone

        try:
            return str(typer.prompt(in_words(question), err=True, **how))
        except typer.Abort:
            if sys.stdin.isatty():
                raise
            raise NotDone(missing) from None

    @contextlib.contextmanager
    def works(self, request: Message) -> Iterator[Callable[[], bool]]:
        tell.print(f"{in_words(request)} {console.say('bringup.ask.enter_none')}")
        yield self._enters

    @staticmethod
    def _enters() -> bool:
        if not sys.stdin.isatty() or not select.select([sys.stdin], [], [], 0.0)[0]:
            return False
        sys.stdin.readline()
        return True


def _tell(run: Session, as_json: bool) -> None:
    """What is done and what is open, and what to write into the machine file."""
    from rich.table import Table

    from controller.bringup import report
    from controller.bringup.protocol import REPORT

    protocol, file = run.protocol, run.protocol.folder / REPORT
    if as_json:
        made = [report.row(protocol, step, run.unfinished.get(step.name)) for step in run.steps]
        rows = messages.with_sentences(made, spoken.get())
        facts = {"machine": protocol.machine, "report": str(file), "steps": rows}
        print(json.dumps({"ok": not run.failed, **facts}))
        return
    table = Table()
    for head in ("step", "what", "verdict"):
        table.add_column(console.say(f"bringup.report.{head}"), no_wrap=head == "step")
    for step in run.steps:
        table.add_row(step.name, in_words(step.text("title")), report.verdict(protocol, step))
    show.print(table)
    for step in run.steps:
        for axis, name, old, new, why in report.proposed(protocol, step):
            key = "bringup.report.propose_spindle" if axis == "spindle" else "bringup.report.propose"
            row = console.say(key, axis=axis, name=name, old=old, new=new, why=why)
            show.print(row, soft_wrap=True)
    tell.print(in_words(report.summary(protocol, run.steps)))
    tell.print(console.say("bringup.report.written", file=file))


def _named(names: Sequence[str], steps: Sequence[Step]) -> frozenset[str]:
    """Steps by name, or all of a kind by that. Raises Misunderstood."""
    found: set[str] = set()
    for name in names:
        its = {step.name for step in steps if name in (EVERY, step.name, step.kind)}
        if not its:
            known = ", ".join(step.name for step in steps)
            raise Misunderstood(console.say("bringup.no_step", found=name, known=known))
        found |= its
    return frozenset(found)


def _values(pairs: Sequence[str], steps: Sequence[Step]) -> dict[str, float]:
    """Raises Misunderstood."""
    found = {}
    for pair in pairs:
        name, _, number = pair.partition("=")
        named = _named([name], steps)
        try:
            if named != {name}:  # all of a kind, or all
                raise ValueError(name)
            found[name] = _finite(number)
        except ValueError:
            raise Misunderstood(console.say("bringup.no_number", found=pair)) from None
    return found


def _skipped(pairs: Sequence[str], steps: Sequence[Step]) -> dict[str, str]:
    """The reason of each step that is left out; one of a kind is that of all of it. Raises Misunderstood."""
    found: dict[str, str] = {}
    for pair in pairs:
        name, _, reason = pair.partition("=")
        if not reason.strip():
            raise Misunderstood(console.say("bringup.no_reason", found=pair))
        found |= dict.fromkeys(_named([name], steps), reason)
    return found


def _finite(number: str) -> float:
    """A number that a gauge can show. Raises ValueError."""
    found = float(number)
    if not math.isfinite(found):
        raise ValueError(number)
    return found
