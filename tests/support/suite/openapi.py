"""Prints what the panel declares of itself (OpenAPI 3.1), for types: what is not declared is not there."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

from support.fakes.panels import Scene


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        scene = Scene(Path(folder))
        print(json.dumps(_closed(scene.app.openapi())))
        scene.store.close()


def _closed(value: Any) -> Any:
    """The same without the leave for more keys than are declared, which a newer panel may take."""
    if isinstance(value, list):
        return [_closed(one) for one in value]
    if not isinstance(value, dict):
        return value
    return {key: _closed(one) for key, one in value.items() if (key, one) != ("additionalProperties", True)}


if __name__ == "__main__":
    main()
