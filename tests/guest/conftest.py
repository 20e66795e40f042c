"""These tests need a kernel with CAN and are run by ``run``; elsewhere they are not collected."""

from __future__ import annotations

import os

collect_ignore_glob = [] if "DIRECTRIX_GUEST" in os.environ else ["test_*.py"]
