"""SQLite files of a folder that others may write, too: see ``own_files``. And what a bad bit costs them."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import sqlite3
import stat
import struct
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import quote

from controller import atomic_file, own_files
from drives.texts import message

NOTE = "-open"  # an empty file: something may be written ahead
BESIDE = ("-wal", "-shm", NOTE)
MODE = 0o640  # SQLite gives -wal and -shm the same
WAIT_S = 10.0  # for another process to end its transaction; all of them are short


class Connection(sqlite3.Connection):
    """Raises sqlite3.Error also where SQLite's own words quote a name that a bad bit has made no text.

    ``noted``: a file, beside which a ``NOTE`` goes with the last connection: see ``ahead``.
    """

    _noted: Path | None = None

    def __init__(self, *given: Any, noted: Path | None = None, **more: Any) -> None:
        super().__init__(*given, **more)
        self._noted = noted

    def close(self) -> None:
        super().close()
        noted, self._noted = self._noted, None
        if noted is not None and not os.path.lexists(_beside(noted, "-wal")):
            with contextlib.suppress(OSError):
                own_files.remove(_beside(noted, NOTE))

    def __del__(self) -> None:
        with contextlib.suppress(sqlite3.Error):  # one that could not be opened is none
            self.close()

    def execute(self, *given: Any) -> sqlite3.Cursor:
        try:
            return super().execute(*given)
        except UnicodeDecodeError as error:
            raise sqlite3.DatabaseError(f"its schema is damaged ({error.reason})") from error


def opened(file: Path) -> sqlite3.Connection:
    """Opens, or makes, a SQLite file that is written ahead (WAL), in no transaction; for any thread.

    SQLite itself follows a link in the place of the database. It also rolls back a journal that it finds
    beside one, and deletes the file that this names. Ours have none, but at the moment they are made: so a
    journal goes, and root opens as the folder's owner, who can delete no more than he could before.

    Raises OSError, sqlite3.Error.
    """
    with own_files.folder(file.parent) as at:
        with contextlib.suppress(FileExistsError):
            flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | own_files.FLAGS
            made = os.open(file.name, flags, MODE, dir_fd=at)
            os.fchmod(made, MODE)
            own_files.give(made, at)
            os.close(made)
        # Looked at without being opened: to close one would give up SQLite's locks of this process.
        owner = os.fstat(at).st_uid
        _remove_what_a_reader_left(file, at, owner)
        facts = _seen(file, at, owner)
        if facts.st_size:
            own_files.remove(_beside(file, "-journal"))
        with _as_owner(at, file.parent):
            sql = _connected(file, facts, at)
            with contextlib.suppress(OSError):  # a full disk forbids nothing
                own_files.opened(_beside(file, NOTE), os.O_WRONLY | os.O_CREAT, mode=MODE).close()
            return sql


@contextlib.contextmanager
def transaction(sql: sqlite3.Connection) -> Iterator[sqlite3.Connection]:
    """One that writes: all of it or, on any exception, nothing. Raises sqlite3.Error."""
    sql.execute("BEGIN IMMEDIATE")
    try:
        yield sql
        sql.execute("COMMIT")
    except BaseException:
        with contextlib.suppress(sqlite3.Error):
            sql.execute("ROLLBACK")
        raise


def migrate(sql: sqlite3.Connection, steps: Sequence[str], version: int) -> None:
    """The schema from this version to the newest, in a transaction; step n makes version n + 1."""
    for step in steps[version:]:
        for statement in step.split(";\n"):
            sql.execute(statement)
    sql.execute(f"PRAGMA user_version = {len(steps)}")


def _beside(file: Path, end: str) -> Path:
    return file.with_name(f"{file.name}{end}")


def _stat(name: str, at: int) -> os.stat_result:
    return os.stat(name, dir_fd=at, follow_symlinks=False)


@contextlib.contextmanager
def reading(file: Path) -> Iterator[sqlite3.Connection]:
    """Opens a SQLite file for who only reads it: all that is read is of one moment.

    Nothing is written, also not beside it: what a stranger left there would be his, and the service's own
    next start would refuse it. It alone takes in what a killed one has written ahead, and says what of it is
    lost. So without a -wal, when nobody has the file open, it is read as it is ("immutable"); with one, by
    the -shm that its writer has made.

    Raises OSError, also where something is lost that nobody has said yet; sqlite3.Error.
    """
    with own_files.folder(file.parent) as at:
        facts = _seen(file, at, os.fstat(at).st_uid)
        if (known := ahead(file)) is not None and _is_bad_after(0, known, file):
            raise own_files.refusal(errno.EIO, message("cli.state.lost"), file)
        written_ahead = os.path.lexists(_beside(file, "-wal"))
        how = "mode=ro&readonly_shm=1" if written_ahead else "mode=ro&immutable=1"
        sql = _connected(file, facts, at, how)
    with contextlib.closing(sql):
        sql.execute("BEGIN")
        yield sql


def _seen(file: Path, at: int, owner: int) -> os.stat_result:
    """Facts of the file, which is what it should be, as is what stands beside it. Raises OSError."""
    for end in BESIDE:
        with contextlib.suppress(FileNotFoundError):
            own_files.see(_stat(file.name + end, at), _beside(file, end), owner, alone=True)
    facts = _stat(file.name, at)
    own_files.see(facts, file, owner, alone=True)
    return facts


def _remove_what_a_reader_left(file: Path, at: int, owner: int) -> None:
    """Removes an empty -wal of another user, and the -shm to it: there is nothing in them."""
    found = {}
    for end in BESIDE:
        with contextlib.suppress(FileNotFoundError):
            found[end] = _stat(file.name + end, at)
    if "-wal" in found and found["-wal"].st_size:
        return
    for end, facts in found.items():
        if stat.S_ISREG(facts.st_mode) and facts.st_uid not in (0, os.geteuid(), owner):
            own_files.remove(_beside(file, end))


def _connected(file: Path, facts: os.stat_result, at: int, how: str = "mode=rw") -> sqlite3.Connection:
    real = Path(os.path.realpath(file.parent), file.name)
    named = f"file:{quote(str(real))}?{how}"
    factory = partial(Connection, noted=file if how == "mode=rw" else None)
    more: Any = {"isolation_level": None, "check_same_thread": False, "factory": factory}
    sql: sqlite3.Connection = sqlite3.connect(named, timeout=WAIT_S, uri=True, **more)
    try:
        opened_as = sql.execute("PRAGMA database_list").fetchone()[2]
        now = _stat(file.name, at)
        if opened_as != str(real) or (now.st_dev, now.st_ino) != (facts.st_dev, facts.st_ino):
            raise own_files.refusal(errno.ELOOP, message("own_file.exchanged"), file)
        if how == "mode=rw":
            sql.execute("PRAGMA journal_mode = WAL")
            sql.execute("PRAGMA synchronous = FULL")  # what was said to be kept stays so after a power loss
        sql.execute("PRAGMA trusted_schema = OFF")
        sql.execute("SELECT count(*) FROM sqlite_master").fetchone()
    except BaseException:
        sql.close()
        raise
    return sql


@contextlib.contextmanager
def _as_owner(at: int, path: Path) -> Iterator[None]:
    """Root does it with the rights of a folder's owner, if he comes there; who is not root, with his own."""
    of, group, comes = os.fstat(at), os.getegid(), False
    if os.geteuid() != 0 or of.st_uid == 0:
        yield
        return
    os.setegid(of.st_gid)
    try:
        os.seteuid(of.st_uid)
        try:
            with contextlib.suppress(PermissionError):
                os.stat(path / ".")
                comes = True
            if not comes:
                os.seteuid(0)
            yield
        finally:
            os.seteuid(0)
    finally:
        os.setegid(group)


# How SQLite writes ahead (sqlite.org/fileformat2.html, "The Write-Ahead Log"): a header of 32 bytes, then
# frames of 24 bytes and a page. Each frame has the header's salts, and sums over all that is before it. What
# is shared beside it (sqlite.org/walformat.html, "The WAL-Index Header") has the count of committed frames
# and their salts, twice.
_HEADER, _FRAME, _SUMS = 32, 24, struct.Struct(">II")
_ORDERS = {0x377F0682: "<", 0x377F0683: ">"}  # magic number: of the bytes that are summed
_INDEX, _COUNT, _SALTS = 48, struct.Struct("=I"), slice(32, 40)
_LOCK, _IN_USE = struct.Struct("hhqqi"), (fcntl.F_WRLCK, os.SEEK_SET, 128, 1, 0)  # of who has it open
_OPEN: dict[tuple[int, int], BinaryIO] = {}  # to close one would give up SQLite's locks of this process
Ahead = tuple[int, bytes]


def ahead(file: Path) -> Ahead | None:
    """How many frames have to be there, and their salts, before a process opens a database: by what one that
    was killed has left beside it. After a power loss that is as old as the disk has it. None: somebody has it
    open.

    Where a ``NOTE`` is all that was left there has to be one.
    """
    try:
        index = _shared(_beside(file, "-shm"))
    except OSError:
        written, noted = _beside(file, "-wal"), os.path.lexists(_beside(file, NOTE))
        return int(noted and (not os.path.lexists(written) or written.lstat().st_size < _HEADER)), b""
    if _LOCK.unpack(fcntl.fcntl(index, fcntl.F_OFD_GETLK, _LOCK.pack(*_IN_USE)))[0] != fcntl.F_UNLCK:
        return None
    data = os.pread(index.fileno(), 2 * _INDEX, 0)
    if len(data) < 2 * _INDEX or data[:_INDEX] != data[_INDEX:]:
        return 0, b""
    return int(_COUNT.unpack_from(data, 16)[0]), data[_SALTS]


def _shared(index: Path) -> BinaryIO:
    """What is shared beside a database, opened once. Raises OSError."""
    for key, one in [*_OPEN.items()]:
        if not os.fstat(one.fileno()).st_nlink:  # nobody locks it any more
            _OPEN.pop(key).close()
    facts = index.lstat()
    key = facts.st_dev, facts.st_ino
    if key not in _OPEN:
        _OPEN[key] = own_files.opened(index, os.O_RDONLY, shared=True)
    return _OPEN[key]


def has_lost(sql: sqlite3.Connection, file: Path, known: Ahead | None = None) -> bool:
    """Whether a bad bit or a cut has cost what was written ahead of a database that was just opened;
    ``known``: what ``ahead`` found before.

    SQLite drops all from the first bad frame on and says nothing. What is left of the time before has other
    salts; what was never committed has the right sums. Raises OSError, sqlite3.Error.
    """
    good = 0  # frames
    with contextlib.suppress(sqlite3.OperationalError):  # a full disk takes none of them; each is looked at
        good = int(sql.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchone()[1])
    if not _is_bad_after(max(0, good), known, file):
        return False
    sql.execute("BEGIN IMMEDIATE")  # what another process was just writing is written now
    try:
        return _is_bad_after(max(0, good), known, file)
    finally:
        sql.execute("ROLLBACK")


def put_lost_aside(sql: sqlite3.Connection, file: Path, known: Ahead | None) -> Path | None:
    """Where that is so: what was written ahead is copied, and what can be read of it is in the database; name
    of the copy. Raises OSError, sqlite3.Error.
    """
    if not has_lost(sql, file, known):
        return None
    written = _beside(file, "-wal")
    aside = own_files.aside(written)
    atomic_file.write(aside, own_files.read_bytes(written, shared=True), mode=MODE)
    sql.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    return aside


def _is_bad_after(good: int, known: Ahead | None, file: Path) -> bool:
    """Whether frames are damaged, or gone, that belong to the ``good`` ones before them. Raises OSError."""
    data, (count, of) = b"", known or (0, b"")
    with contextlib.suppress(FileNotFoundError):
        data = own_files.read_bytes(_beside(file, "-wal"), shared=True)
    if len(data) < _HEADER:
        return count > 0
    order, size = _ORDERS.get(int.from_bytes(data[:4], "big"), ""), int.from_bytes(data[8:12], "big")
    salts, sums = data[16:24], _SUMS.unpack_from(data, 24)
    if not order or _summed(data[:24], (0, 0), order) != sums:
        return True
    most = count if of == salts else 0
    length = _FRAME + size
    frames = [data[at : at + length] for at in range(_HEADER, len(data) - length + 1, length)]
    if good:
        if good > len(frames) or frames[good - 1][8:16] != salts:
            return False  # begun anew meanwhile
        sums = _SUMS.unpack_from(frames[good - 1], 16)
    for i, frame in enumerate(frames[good:], good):
        found, before = _SUMS.unpack_from(frame, 16), sums
        right = _summed(frame[_FRAME:], _summed(frame[:8], before, order), order) == found
        if right and frame[8:16] == salts:
            sums = found
            continue
        return right or i < most or any(one[8:16] == salts for one in frames[i:])
    return len(frames) < most


def _summed(data: bytes, sums: tuple[int, ...], order: str) -> tuple[int, int]:
    a, b = sums
    for one, other in struct.iter_unpack(f"{order}II", data):
        a = (a + one + b) & 0xFFFFFFFF
        b = (b + other + a) & 0xFFFFFFFF
    return a, b
