"""A function of a test in a Python of its own: where what is counted is that of all objects there are.

In the process of the tests, a look through the millions that thousands of tests leave takes seconds.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from typing import Any

CHILD = """
import importlib.util, json, sys
sys.path[:], path, name, arguments = json.loads(sys.stdin.read())
spec = importlib.util.spec_from_file_location("its_tests", path)
module = sys.modules["its_tests"] = importlib.util.module_from_spec(spec)
spec.loader.exec_module(module)
result = getattr(module, name)(*arguments)
open(int(sys.argv[1]), "w").write(json.dumps(result))
"""


def result_of(function: Callable[..., Any], *arguments: object) -> Any:
    """What a function of a test module returns; arguments as text, the result as JSON has it.

    Raises AssertionError with its traceback where it raised.
    """
    path = function.__code__.co_filename
    asked = json.dumps([sys.path, path, function.__name__, [str(one) for one in arguments]])
    read_end, write_end = os.pipe()
    with os.fdopen(read_end) as answer:
        try:
            done = subprocess.run(
                [sys.executable, "-c", CHILD, str(write_end)],
                input=asked,
                text=True,
                capture_output=True,
                check=False,
                pass_fds=[write_end],
            )
        finally:
            os.close(write_end)
        assert done.returncode == 0, done.stderr
        return json.loads(answer.read())
