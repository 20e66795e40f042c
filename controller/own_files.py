"""Files of a folder that others may write, too: none of their links is followed, none of their files taken.

Service and panel share the state folder, and root's verbs work in it. Whoever holds the panel can put there
what he likes, and exchange it at any moment. So every folder on the way to a file is opened by its own,
relative to the one before (``openat``, ``O_NOFOLLOW``), a file only if it is a regular one that has no second
name, and what the service goes by only if it belongs to whom it should:

    with own_files.folder(state / "runs" / name, state) as at:     # a descriptor; no link from ``state`` on
        os.fsync(at)
    own_files.read_bytes(state / "machine.json")                   # of the service or root, or OSError

``within`` is the folder that an operator named; it may be reached by links. Where it is left out, it is the
one that holds the file. ``shared``: the panel's files, which may belong to anybody who may write there. What
root makes belongs to the owner of the folder, as if the service had made it.
"""

from __future__ import annotations

import contextlib
import errno
import os
import pwd
import shutil
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

from drives.texts import Message, english, message

MODE = 0o644  # less the umask: the group reads
LONGEST_ASIDE = 100  # names of what could not be read
FLAGS = os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC  # a pipe that nobody writes is not waited for
_FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC


def refusal(code: int, why: Message, path: Path) -> OSError:
    """An error of the kind that its number has, with a text of its own."""
    error = OSError(code, english(why), str(path))
    vars(error)["said"] = why
    return error


# -- folders


@contextlib.contextmanager
def folder(path: Path, within: Path | None = None, make: bool = False) -> Iterator[int]:
    """Opens a folder, and makes what is missing of it where asked to. Raises OSError."""
    within = within or path
    if make:
        within.mkdir(parents=True, exist_ok=True)
    at = os.open(within, _FOLDER)
    try:
        for part in path.relative_to(within).parts:
            inner = _inner(at, part, path, make)
            os.close(at)
            at = inner
        yield at
    finally:
        os.close(at)


def _inner(at: int, part: str, path: Path, make: bool) -> int:
    if part == os.pardir:
        raise refusal(errno.EINVAL, message("own_file.leads_out"), path)
    if make:
        with contextlib.suppress(FileExistsError):
            os.mkdir(part, dir_fd=at)
    try:
        inner = os.open(part, _FOLDER | os.O_NOFOLLOW, dir_fd=at)
    except OSError as error:
        if error.errno in (errno.ELOOP, errno.ENOTDIR):
            raise refusal(error.errno, message("own_file.link", name=part), path) from error
        raise
    if make:
        give(inner, at)
    return inner


def give(handle: int, at: int) -> None:
    """What root has made in another's folder is that other's."""
    if os.geteuid() == 0 and os.fstat(handle).st_uid == 0 != (of := os.fstat(at)).st_uid:
        os.fchown(handle, of.st_uid, of.st_gid)


def make_folder(path: Path, within: Path | None = None) -> None:
    """Makes a folder with those above it, where there is none. Raises OSError."""
    with folder(path, within, make=True):
        pass


def make_private(path: Path) -> Path:
    """Makes a folder that nobody but its owner may write, where there is none. Raises OSError for another."""
    with contextlib.suppress(FileExistsError):
        os.mkdir(path, 0o700)
    with folder(path, path.parent) as at:
        facts = os.fstat(at)
    if facts.st_uid not in (0, os.geteuid()) or facts.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise refusal(errno.EPERM, message("own_file.of_others"), path)
    return path


def make_new_folder(path: Path, within: Path | None = None) -> None:
    """Makes a folder that was not there. Raises FileExistsError, OSError."""
    with folder(path.parent, within, make=True) as at:
        os.mkdir(path.name, dir_fd=at)
        os.close(_inner(at, path.name, path, make=True))


def names(path: Path, within: Path | None = None) -> list[str]:
    """Names of what a folder holds, sorted; none where there is no such folder. Raises OSError."""
    try:
        with folder(path, within) as at:
            return sorted(os.listdir(at))
    except FileNotFoundError:
        return []


# -- files


def opened(
    file: Path,
    flags: int,
    within: Path | None = None,
    shared: bool = False,
    mode: int = MODE,
    buffering: int = -1,
) -> BinaryIO:
    """Opens a regular file. Raises OSError, also for a link or a file of a stranger."""
    with folder(file.parent, within) as at:
        handle = os.open(file.name, flags | FLAGS, mode, dir_fd=at)
        try:
            owner, facts = None if shared else os.stat(within or file.parent).st_uid, os.fstat(handle)
            # Whoever may write in a folder gives what he may not read a second name there, and root reads it.
            lent = os.geteuid() == 0 and facts.st_uid != os.fstat(at).st_uid
            see(facts, file, owner, alone=lent or flags & os.O_ACCMODE != os.O_RDONLY)
            if flags & os.O_CREAT:
                give(handle, at)
            os.set_blocking(handle, True)
            found: Any = os.fdopen(handle, _KINDS[flags & os.O_ACCMODE], buffering)
            return found  # type: ignore[no-any-return]
        except BaseException:
            os.close(handle)
            raise


_KINDS = {os.O_RDONLY: "rb", os.O_WRONLY: "wb", os.O_RDWR: "r+b"}


def see(facts: os.stat_result, file: Path, owner: int | None, alone: bool) -> None:
    """Raises OSError for what was put in the place of a file; ``alone``: by a second name, too.

    ``owner``: of the state folder; None: it may belong to anybody.
    """
    if not stat.S_ISREG(facts.st_mode):
        raise refusal(errno.EINVAL, message("own_file.not_regular"), file)
    if alone and facts.st_nlink > 1:
        raise refusal(errno.EMLINK, message("own_file.second_name"), file)
    if owner is not None and facts.st_uid not in (0, os.geteuid(), owner):
        raise refusal(errno.EPERM, message("own_file.of_user", user=facts.st_uid), file)


def may_read(user: int, file: Path, facts: os.stat_result) -> bool:
    """Finds out whether a user could read a file himself: it is his, or modes and folders allow it.

    A file without a size is the kernel's (``/proc``), where modes are not all that counts: it is not read.
    """

    def has(of: os.stat_result, bit: int) -> bool:
        shift = 6 if of.st_uid == user else 3 if of.st_gid in groups else 0
        return bool(of.st_mode >> shift & bit)

    try:
        entry = pwd.getpwuid(user)
        groups = os.getgrouplist(entry.pw_name, entry.pw_gid)
    except KeyError:  # of a container, say
        groups = []
    ways = all(has(one.stat(), os.X_OK) for one in file.resolve().parents)
    return facts.st_uid == user or (facts.st_size > 0 and has(facts, os.R_OK) and ways)


def read_bytes(file: Path, within: Path | None = None, shared: bool = False) -> bytes:
    """A whole file. Raises OSError."""
    with opened(file, os.O_RDONLY, within, shared) as found:
        return found.read()


def read_text(file: Path, within: Path | None = None, shared: bool = False) -> str:
    """A whole file of UTF-8. Raises OSError, ValueError."""
    return read_bytes(file, within, shared).decode()


def new(file: Path, within: Path | None = None, mode: int = MODE, buffering: int = -1) -> BinaryIO:
    """Opens a file that was not there, to be written; what had its name goes. Raises OSError."""
    remove(file, within)
    return opened(file, os.O_RDWR | os.O_CREAT | os.O_EXCL, within, mode=mode, buffering=buffering)


def remove(file: Path, within: Path | None = None) -> None:
    """Removes a file, or the link that has its name; there may be none. Raises OSError."""
    with contextlib.suppress(FileNotFoundError), folder(file.parent, within) as at:
        os.unlink(file.name, dir_fd=at)


def remove_tree(path: Path, within: Path | None = None) -> None:
    """Removes a folder with all that is in it, as far as it can be removed."""
    with contextlib.suppress(OSError), folder(path.parent, within) as at:
        shutil.rmtree(path.name, ignore_errors=True, dir_fd=at)


def rename(file: Path, to: Path, within: Path | None = None) -> None:
    """Gives a file another name, also in another folder; what had that name goes. Raises OSError."""
    with folder(file.parent, within) as at, folder(to.parent, within) as there:
        os.replace(file.name, to.name, src_dir_fd=at, dst_dir_fd=there)


def share(file: Path, to: Path, within: Path | None = None) -> None:
    """Has one file two names, where the file system knows that. Raises OSError; then all is as it was."""
    link = to.with_name(f"{to.name}.link")
    remove(link, within)
    with folder(file.parent, within) as at, folder(to.parent, within) as there:
        os.link(file.name, link.name, src_dir_fd=at, dst_dir_fd=there, follow_symlinks=False)
    rename(link, to, within)


def put_aside(file: Path, within: Path | None = None) -> Path | None:
    """Gives a file that cannot be read a name beside its own that is free; None: it could not be done."""
    with contextlib.suppress(OSError):
        to = aside(file, within)
        rename(file, to, within)
        return to
    return None


def aside(file: Path, within: Path | None = None) -> Path:
    """A name beside a file's own that is free; the last of many is not. Raises OSError."""
    taken = set(names(file.parent, within))
    free = (
        f"{file.name}.damaged{n}" for n in range(1, LONGEST_ASIDE) if f"{file.name}.damaged{n}" not in taken
    )
    return file.with_name(next(free, f"{file.name}.damaged{LONGEST_ASIDE}"))
