"""What another user does: the service's or the panel's, as they are installed."""

from __future__ import annotations

import os
import traceback
from collections.abc import Callable

import pytest

SERVICE, PANEL, GROUP = 64001, 64002, 64000
needs_root = pytest.mark.skipif(os.geteuid() != 0, reason="a second user takes root to make")


def ends_well(user: int, do: Callable[[], object]) -> bool:
    """Whether a process of a user that does it, with the units' umask, ends without an error."""
    if (child := os.fork()) == 0:
        failed = 1
        try:
            os.setgroups([])
            os.setgid(GROUP)
            os.setuid(user)
            os.umask(0o027)
            do()
            failed = 0
        except BaseException:
            traceback.print_exc()
        finally:  # or the tests after this one would go on in the child, too
            os._exit(failed)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
