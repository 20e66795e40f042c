"""What versions before left in a state folder: sealed files with the generation before beside each."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path
from typing import Any

from controller import sealed_file


def write(file: Path, values: Any) -> None:
    """As the file's next generation; what was there is the one before."""
    generation = 1
    with contextlib.suppress(FileNotFoundError):
        before = sealed_file.before(file)
        before.write_bytes(file.read_bytes())
        generation = int(json.loads(before.read_text())[sealed_file.SEAL]["generation"]) + 1
    file.write_text(sealed_file.text(values, file.name, generation))
