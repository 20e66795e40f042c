"""``--workers`` and ``--cluster`` of the commands whose work is per surface or per program."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Annotated

import typer

from controller import workers
from controller.verify.console import Refused, in_words

Count = Annotated[int, typer.Option("--workers", min=0, metavar="N")]
Cluster = Annotated[str, typer.Option("--cluster", metavar="ADDRESS")]


@contextlib.contextmanager
def spread(count: int, cluster: str) -> Iterator[workers.Spread]:
    """How work is spread. Raises Refused where there is nobody to do it."""
    try:
        with workers.Workers(count, cluster) as started:
            yield started.each
    except workers.WorkersLost as error:
        raise Refused(in_words(error.said)) from error
