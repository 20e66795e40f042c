"""Files that a command writes: where there is one already, only with --overwrite."""

from __future__ import annotations

import os
from pathlib import Path

from controller.verify.console import Refused, say


def target(out: Path, overwrite: bool, option: str, suffix: str = "") -> Path:
    """The file to write, by the option that names it. Raises Refused where it cannot be."""
    if suffix and out.suffix != suffix:
        raise Refused(say("cli.out.suffix", out=out, option=option, suffix=suffix))
    if out.exists() and not overwrite:
        raise Refused(say("cli.out.exists", out=out, option=option))
    if not out.parent.is_dir():
        raise Refused(say("cli.out.no_folder", out=out, parent=out.parent))
    return out


def save(out: Path, text: str) -> None:
    """Write it whole or not at all."""
    beside = out.with_name(f".{out.name}.new")
    beside.write_text(text)
    os.replace(beside, out)
