"""Frozen dataclasses that are made quickly (``drives.values``, which both folders import)."""

from drives.values import dataclass as dataclass
