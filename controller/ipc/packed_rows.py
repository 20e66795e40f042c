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
    """Rows of shape (N, len(ROW)) as values of JSON.

    Column by column, all first bytes, then all second ones: those of one column are alike.
    """
    columns = np.ascontiguousarray(rows.T, dtype="<f8").tobytes()
    data = zlib.compress(np.frombuffer(columns, dtype=np.uint8).reshape(-1, 8).T.tobytes(), 1)
    return {"columns": len(ROW), "rows": base64.b64encode(data).decode()}


def unpacked(told: Mapping[str, Any]) -> Rows:
    """The same rows. Raises ValueError for anything that ``packed`` of this version does not make."""
    try:
        data = zlib.decompress(base64.b64decode(str(told["rows"]), validate=True))
        if int(told["columns"]) != len(ROW):
            raise ValueError("other columns")
        columns = np.frombuffer(data, dtype=np.uint8).reshape(8, -1).T.tobytes()
        return np.frombuffer(columns, dtype="<f8").reshape(len(ROW), -1).T.astype(float, order="C")
    except (KeyError, TypeError, zlib.error, binascii.Error) as error:
        raise ValueError(str(error)) from error
