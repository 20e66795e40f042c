"""A program of the store, given to the service to be loaded."""

from __future__ import annotations

import asyncio
from typing import Any

from controller.api.service_client import ServiceClient
from controller.api.store import Store


async def load(store: Store, door: ServiceClient, name: str, **where: Any) -> dict[str, Any]:
    """What the service answers; "done" is false while it is still being read. Raises Refusal, StoreError."""
    program = await asyncio.to_thread(store.programs.get, name)
    if files := await asyncio.to_thread(store.programs.called, program):
        where |= {"files": files}
    path = str(store.programs.path(program.sha256))
    return await door.ask("load", path=path, name=program.name, sha256=program.sha256, **where)
