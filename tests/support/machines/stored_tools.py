"""Where the tools are of a state folder, with the service's store that is opened and closed for it."""

from __future__ import annotations

from pathlib import Path

from controller.store.service_store import ServiceStore
from controller.store.tool_store import ToolStore


class StoredTools(ToolStore):
    """As the service has it open."""

    def __init__(self, folder: Path) -> None:
        self.kept = ServiceStore(folder)
        super().__init__(self.kept)

    def close(self) -> None:
        self.kept.close()
