"""Back-ups: saved and taken away here, put back by the command line alone."""

from __future__ import annotations

import asyncio
import os

from fastapi import Request
from pydantic import Field

from controller import own_files
from controller.api import models, own_backups, ticks
from controller.api.access import panel_of
from controller.api.answers import Refusal
from controller.api.own_backups import Saved
from controller.api.router import SET_UP, VIEW, Router
from controller.api.routes.records import FILE, FileName, Opened
from controller.machine.toml_table import ConfigError
from controller.messages import Key, of_error

router = Router(tags=["back-up"])


class Backup(models.Told):
    """An archive of machine file, offsets, tools, settings and programs; no users, no passwords."""

    name: str
    made_s: float = Field(description="Seconds since 1970.")
    size: int = Field(description="Bytes.")


class BackupList(models.Told):
    backups: list[Backup] = Field(description="The latest first.")
    kept: int = Field(description="So many are kept; the oldest go.")
    folder: str = Field(description="Where they are, on the panel's computer.")
    state: str = Field(description="The state folder, that a restore is given.")


@router.get("/backups", VIEW, 503)
async def backups(request: Request) -> BackupList:
    """The back-ups that were saved from here.

    They are put back at the command line, with the service stopped: `directrix backup restore`.
    """
    store = panel_of(request).store
    try:
        found = await asyncio.to_thread(own_backups.saved, store)
    except OSError as error:
        raise Refusal.of(503, "store", "no_backup", why=of_error(error)) from error
    return BackupList(
        backups=[_facts(one) for one in found],
        kept=own_backups.KEPT,
        folder=str(own_backups.folder_of(store)),
        state=str(store.folder.resolve()),
    )


@router.post("/backups", SET_UP, 404, 429, 503, 507, status_code=201)
async def save(request: Request) -> Backup:
    """Save a back-up of now; also while the machine runs."""
    panel = panel_of(request)
    if panel.saving.locked():
        raise Refusal.of(429, "many", "backup_busy", headers={"Retry-After": "1"})
    async with panel.saving:
        await asyncio.to_thread(ticks.machine_of, panel.store.folder)  # or a refusal that says there is none
        try:
            return _facts(await asyncio.to_thread(own_backups.save, panel.store))
        except (ConfigError, OSError, ValueError) as error:
            raise Refusal.of(503, "store", "no_backup", why=of_error(error)) from error


@router.get("/backups/{file}", SET_UP, 404, 422, carries=FILE)
async def download(request: Request, file: FileName) -> Opened:
    """One of them, to be kept elsewhere."""
    folder = own_backups.folder_of(panel_of(request).store)

    def opened() -> Opened:
        try:
            return Opened(own_files.opened(folder / file, os.O_RDONLY, folder.parent, shared=True), file)
        except OSError:
            raise Refusal.of(404, "missing", "missing", what=Key("what.backup"), name=file) from None

    return await asyncio.to_thread(opened)


def _facts(one: Saved) -> Backup:
    return Backup(**one._asdict())
