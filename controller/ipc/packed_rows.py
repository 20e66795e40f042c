"""Rows of the recorder as they go through the door, and on to a browser."""

from __future__ import annotations

import base64
import binascii
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from controller.ipc.handoff import ROW

Rows = npt.NDArray[np.float64]


def packed(rows: Rows) -> dict[str, Any]:
    """Rows of shape (N, len(ROW)) as values of JSON."""
    data = zlib.compress(np.ascontiguousarray(rows, dtype="<f8").tobytes(), 1)
    return {"columns": len(ROW), "rows": base64.b64encode(data).decode()}


def unpacked(told: Mapping[str, Any]) -> Rows:
    """The same rows. Raises ValueError for anything that ``packed`` of this version does not make."""
    try:
        data = zlib.decompress(base64.b64decode(str(told["rows"]), validate=True))
        if int(told["columns"]) != len(ROW):
            raise ValueError("other columns")
        return np.frombuffer(data, dtype="<f8").reshape(-1, len(ROW)).astype(float)
    except (KeyError, TypeError, zlib.error, binascii.Error) as error:
        raise ValueError(str(error)) from error
