"""``directrix service update`` and ``rollback``: another version beside the one that is there, and back.

A release is a wheel, with its SHA-256 beside it as ``sha256sum`` writes it. Its lock is in it. Every version
has an environment of its own, ``/opt/directrix-0.2.0``; the units run one of them. The file ``environments``
beside the environment file names them, the one in use last. Nothing is started or stopped here.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import sys
import tempfile
import zipfile
from pathlib import Path

from controller import atomic_file
from controller.cli import installation, locked
from controller.cli.installation import ENVIRONMENT, TARGET
from controller.cli.privileged import as_root, run
from controller.verify.console import Refused, refusals, say, show

ENVIRONMENTS = ENVIRONMENT.with_name("environments")
LINK = Path("/usr/local/bin/directrix")
WHEEL = re.compile(r"directrix-(?P<version>[0-9][0-9A-Za-z.+!]*)-py3-none-any\.whl")


def update(wheel: Path, sha256: str = "", packages: Path | None = None) -> None:
    """Install a release beside this version, by its lock, and have the services run it from their next start.

    The environment of this version stays: rollback goes back to it.
    """
    with refusals(False):
        as_root("update")
        with tempfile.TemporaryDirectory() as scratch:
            version, own, lock = checked(wheel, sha256, Path(scratch))
            made, known = environment_of(version), environments()
            if made.exists():
                raise Refused(say("cli.service.environment_exists", folder=made))
            try:
                install(made, own, lock, packages)
                use(made, known[-1])
            except BaseException:
                shutil.rmtree(made, ignore_errors=True)
                raise
        _write([*(one for one in known if one != made), made])
        _link(made)
        show.print(say("cli.service.updated", version=version, folder=made, before=known[-1], target=TARGET))


def rollback() -> None:
    """Have the services run the version before the last update from their next start; nothing is deleted."""
    with refusals(False):
        as_root("rollback")
        known = [one for one in environments() if python_of(one).exists()]
        if len(known) < 2:
            raise Refused(say("cli.service.nothing_before", file=ENVIRONMENTS))
        last, before = known[-1], known[-2]
        _write_units(before, "--unlocked")  # it ran before, whatever its packages are
        _write([*known[:-2], last, before])  # twice: as it was
        _link(before)
        show.print(say("cli.service.rolled_back", folder=before, after=last, target=TARGET))


def checked(wheel: Path, sha256: str, scratch: Path) -> tuple[str, Path, Path]:
    """Version of a release, a copy of the wheel and its lock: of the very bytes whose sum is right.

    Raises Refused, OSError.
    """
    named = WHEEL.fullmatch(wheel.name)
    if named is None:
        raise Refused(say("cli.service.no_release", file=wheel))
    data = wheel.read_bytes()
    wanted, found = (sha256 or _beside(wheel)).lower(), hashlib.sha256(data).hexdigest()
    if not wanted:
        raise Refused(say("cli.service.no_sum", file=wheel))
    if wanted != found:
        raise Refused(say("cli.service.other_sum", file=wheel, found=found, wanted=wanted))
    own, lock = scratch / wheel.name, scratch / locked.LOCK
    own.write_bytes(data)
    try:
        with zipfile.ZipFile(own) as archive:
            lock.write_bytes(archive.read(f"config/systemd/{locked.LOCK}"))
        locked.locked(lock.read_text())
    except (KeyError, ValueError, zipfile.BadZipFile) as error:
        raise Refused(say("cli.service.no_lock", file=wheel)) from error
    return named["version"], own, lock


def _beside(wheel: Path) -> str:
    """The sum that lies beside a release; empty where there is none."""
    file = wheel.with_name(f"{wheel.name}.sha256")
    words = file.read_text().split() if file.is_file() else []
    return words[0] if words else ""


def install(made: Path, wheel: Path, lock: Path, packages: Path | None) -> None:
    """Makes the environment. Raises Refused."""
    base = Path(getattr(sys, "_base_executable", sys.executable))
    run(str(base), "-m", "venv", str(made))
    pip = [str(python_of(made)), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    local = [] if packages is None else ["--no-index", "--find-links", str(packages)]
    run(*pip, "--require-hashes", "--no-deps", *local, "-r", str(lock))
    run(*pip, "--no-index", "--no-deps", str(wheel))


def use(made: Path, before: Path) -> None:
    """Has the units run an environment, or, where that fails, the one before as they did. Raises Refused."""
    try:
        _write_units(made)
    except BaseException:
        _write_units(before, "--unlocked")
        raise


def _write_units(environment: Path, *more: str) -> None:
    run(str(python_of(environment)), "-P", "-m", "controller", "service", "install", *more)


def environments() -> list[Path]:
    """All that the services ran by now, the one in use last."""
    known = [Path(line) for line in ENVIRONMENTS.read_text().splitlines()] if ENVIRONMENTS.is_file() else []
    return known or [Path(sys.prefix)]


def environment_of(version: str) -> Path:
    """Beside the one that runs this."""
    here = Path(sys.prefix)
    stem = re.sub(r"-[0-9][0-9A-Za-z.+!]*$", "", here.name)
    return here.with_name(f"{stem}-{version}")


def python_of(environment: Path) -> Path:
    return environment / "bin" / "python"


def _write(known: list[Path]) -> None:
    atomic_file.write(ENVIRONMENTS, "".join(f"{one}\n" for one in known))


def _link(environment: Path) -> None:
    """The command, where it is a link to one of our environments."""
    ours = LINK.is_symlink() and Path(os.readlink(LINK)).name == installation.COMMAND
    if ours:
        new = LINK.with_name(f"{LINK.name}.new")
        new.unlink(missing_ok=True)
        new.symlink_to(environment / "bin" / installation.COMMAND)
        new.replace(LINK)
