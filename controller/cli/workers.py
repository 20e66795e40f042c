"""``--workers`` and ``--cluster`` of the commands whose work is per surface or per program."""

from __future__ import annotations

from typing import Annotated

import typer

Count = Annotated[int, typer.Option("--workers", min=0, metavar="N")]
Cluster = Annotated[str, typer.Option("--cluster", metavar="ADDRESS")]
