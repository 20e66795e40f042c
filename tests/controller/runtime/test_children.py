"""How a process is asked to end."""

from __future__ import annotations

import signal

import pytest

from controller.runtime import children


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_ctrl_c_is_not_lost_where_python_drops_what_comes_up() -> None:
    class Pressed:
        def __del__(self) -> None:
            signal.raise_signal(signal.SIGINT)

    before = signal.getsignal(signal.SIGINT)
    with children.CtrlC() as ctrl_c:
        ctrl_c.look()
        Pressed()
        with pytest.raises(KeyboardInterrupt):
            ctrl_c.look()
    assert signal.getsignal(signal.SIGINT) is before
    with children.CtrlC(), pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGTERM)
