"""What root's verbs share: that it is root who gives them, and the system's own commands."""

from __future__ import annotations

import os
import subprocess

from controller.verify.console import Refused, say


def as_root(what: str) -> None:
    """Raises Refused for anybody else."""
    if os.geteuid() != 0:
        raise Refused(say("cli.service.as_root", what=what))


def run(*command: str) -> str:
    """Its standard output. Raises Refused with its own words."""
    try:
        done = subprocess.run(command, capture_output=True, text=True)
    except FileNotFoundError:
        raise Refused(say("cli.service.no_command", command=command[0])) from None
    if done.returncode:
        words = done.stderr.strip() or say("cli.service.code", code=done.returncode)
        raise Refused(say("cli.service.failed", command=" ".join(command), why=words))
    return done.stdout
