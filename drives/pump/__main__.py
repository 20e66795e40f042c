"""``python -P -m drives.pump JOB``: what a tick's process starts; nothing for an operator."""

from __future__ import annotations

import sys

from drives.pump import process

if __name__ == "__main__":
    sys.exit(process.main(process.Job.from_text(sys.argv[1])))
