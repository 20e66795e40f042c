"""The seed of tests that try something else each time; print it, and a failure can be had again.

DIRECTRIX_TEST_SEED=4711 pytest ...
"""

from __future__ import annotations

import os
import random

SEED = int(os.environ.get("DIRECTRIX_TEST_SEED", random.SystemRandom().randrange(10**6)))
