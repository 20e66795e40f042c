"""Linear systems with a symmetric, positive definite band matrix, by LAPACK's ``dpbsv`` as scipy wraps it.

Of scipy its wrapper of LAPACK alone is loaded: the package around it takes 0.14 s to import, a
third of what a command needs to start, and has nothing else that plans need.
"""

from __future__ import annotations

from importlib import import_module
from importlib.machinery import PathFinder
from importlib.util import module_from_spec
from pathlib import Path
from types import ModuleType

import numpy as np

from controller.geometry.arrays import Array

WRAPPER = "scipy.linalg._flapack"


def _loaded() -> ModuleType:
    """The wrapper, past its package; by the package where a scipy is laid out differently."""
    scipy = PathFinder.find_spec("scipy")
    folders = scipy.submodule_search_locations if scipy else None
    found = PathFinder.find_spec(WRAPPER, [str(Path(folder, "linalg")) for folder in folders or ()])
    if found is None or found.loader is None:
        return import_module("scipy.linalg.lapack")
    wrapper = module_from_spec(found)
    found.loader.exec_module(wrapper)
    return wrapper


_dpbsv = _loaded().dpbsv


def solve(band: Array, right: Array) -> Array:
    """x with M x = ``right`` (n,) or (n, m); ``band`` (k + 1, n) has M's diagonals as LAPACK wants them.

    The diagonal is the last row, the k-th above it the first: ``band[k + i - j, j]`` is M[i, j].
    Raises LinAlgError where M is not positive definite.
    """
    _, x, info = _dpbsv(band, right)
    if info:
        raise np.linalg.LinAlgError(f"the matrix is not positive definite (row {info})")
    return np.asarray(x)
