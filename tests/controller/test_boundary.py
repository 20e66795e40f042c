"""What a panel, or a serial line, that is in somebody else's hands can do to the controller: nothing.

Each of them runs as the panel's user, in the group that reads the state folder. It tries all that a file
system has on each of the controller's and root's files and folders; then nothing of them is another.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from support.fakes import cutting_service
from support.fakes.fake_engine import served
from support.machines.stepped_runs import shipped
from support.suite.other_user import GROUP, PANEL, SERVICE, ends_well, needs_root

from controller.api import own_folder
from controller.api.routes import bring_up
from controller.api.store import Store, StoreError
from controller.api.uploads import UploadLimits
from controller.ipc.control_socket import CommandRefused
from controller.plan.report import stored
from controller.service import jobs

pytestmark = needs_root
Tries = Callable[[Path, Path], object]  # of a victim, with a file of the panel's


@pytest.fixture(scope="module")
def used() -> Iterator[Path]:
    """A state folder after a run, with programs and users."""
    with tempfile.TemporaryDirectory() as made:
        service = served(Path(made))
        cutting_service.cut(service)
        service.watch.look()
        state = service.state
        service.close()
        with contextlib.closing(Store(state, UploadLimits(free_bytes=0))) as store:
            with store.uploads.begin("a.ngc") as upload:
                upload.write(b"G0 X1\nM2\n")
                upload.commit()
            store.users.set("anna", "hash", "set_up")
        yield state


@pytest.fixture
def state(used: Path) -> Iterator[Path]:
    """As ``directrix.tmpfiles`` has it, beside it a back-up and a machine file of root's."""
    with tempfile.TemporaryDirectory() as made:
        place = Path(made).resolve()
        place.chmod(0o755)
        state = Path(shutil.copytree(used, place / "state"))
        for path in (state, *state.rglob("*")):
            os.chown(path, PANEL if path.is_relative_to(state / own_folder.PANEL) else SERVICE, GROUP)
            path.chmod(0o750 if path.is_dir() else 0o640)
        for folder, mode in (("state-backups", 0o700), ("etc", 0o755)):
            (place / folder).mkdir(mode=mode)
            (place / folder / "kept").write_text("root's")
        yield state


def of_others(state: Path) -> dict[Path, tuple[object, ...]]:
    """Owner, mode, names and content of all that is not the panel's."""
    own, found = own_folder.of(state), {}
    for path in sorted(state.parent.rglob("*")):
        if path != own and own not in path.parents:
            facts = path.lstat()
            content = path.read_bytes() if path.is_file() else b""
            found[path] = (facts.st_mode, facts.st_uid, facts.st_gid, facts.st_nlink, content)
    return found


def _overwrite(victim: Path, own: Path) -> None:
    with open(victim / "new" if victim.is_dir() else victim, "ab") as file:
        file.write(b"forged")


def _second_name(victim: Path, own: Path) -> None:
    os.link(victim, own.with_name("link"))
    with open(own.with_name("link"), "ab") as file:
        file.write(b"forged")


def _through_link(victim: Path, own: Path) -> None:
    own.with_name("soft").symlink_to(victim)
    _overwrite(own.with_name("soft"), own)


def _remove(victim: Path, own: Path) -> None:
    victim.rmdir() if victim.is_dir() else victim.unlink()


TRIES: dict[str, Tries] = {
    "overwrite": _overwrite,
    "cut short": lambda victim, own: os.truncate(victim, 0),
    "remove": _remove,
    "put another in its place": lambda victim, own: os.replace(own, victim),
    "take away": lambda victim, own: victim.rename(own.with_name("taken")),
    "plant a link beside it": lambda victim, own: victim.with_name("planted").symlink_to(own),
    "plant a file beside it": lambda victim, own: victim.with_name("planted").write_bytes(b""),
    "write by a second name": _second_name,
    "write through a link": _through_link,
    "open to all": lambda victim, own: victim.chmod(0o777),
    "make its own": lambda victim, own: os.chown(victim, PANEL, GROUP),
}


@pytest.mark.parametrize("tries", TRIES)
def test_nothing_of_the_controller_or_of_root_is_changed(state: Path, tries: str) -> None:
    before = of_others(state)
    victims = [state, *before]

    def attack() -> None:
        own = own_folder.of(state) / "tools" / "own"
        for number, victim in enumerate(victims):
            own.parent.with_name(f"{number}").mkdir()
            mine = own.parent.with_name(f"{number}") / "own"
            mine.write_bytes(b"forged")
            try:
                TRIES[tries](victim, mine)
            except OSError:
                continue
            raise AssertionError(f"{tries}: {victim}")

    assert len(victims) > 10 and ends_well(PANEL, attack)
    assert of_others(state) == before


def test_the_panel_works_in_its_folder_and_the_controller_reads_programs_there(state: Path) -> None:
    def upload() -> None:
        with contextlib.closing(Store(state, UploadLimits(free_bytes=0))) as store:
            with store.uploads.begin("b.ngc") as upload:
                upload.write(b"G0 X2\nM2\n")
                upload.commit()
            store.audit.add("anna", "127.0.0.1", "POST")

    def read() -> None:
        assert len(list((own_folder.of(state) / "programs").glob("*.ngc"))) == 2
        for program in (own_folder.of(state) / "programs").glob("*.ngc"):
            assert program.read_bytes()

    assert ends_well(PANEL, upload) and ends_well(SERVICE, read)
    assert not ends_well(SERVICE, lambda: (own_folder.of(state) / "programs" / "x").write_text(""))


def test_the_protocol_of_a_bring_up_at_the_page_is_kept_where_the_panel_may_write(state: Path) -> None:
    def skips() -> None:
        with contextlib.closing(Store(state)) as store:
            protocol, steps = bring_up._opened(SimpleNamespace(store=store))
            protocol.skip(steps[0].name, "It is not wired.")
            again, _ = bring_up._opened(SimpleNamespace(store=store))
            assert [*again.done] == [steps[0].name]

    assert ends_well(PANEL, skips)


def test_a_check_that_the_panel_has_forged_is_none_that_a_start_goes_by(state: Path) -> None:
    own, key = state / "checks", "a" * 64
    own.mkdir(exist_ok=True)
    os.chown(own, SERVICE, GROUP)
    file = stored.save(stored.Stored(1, 1.0, 1, {}), key, own)
    for user, counts in ((SERVICE, True), (PANEL, False)):
        os.chown(file, user, GROUP)
        assert ends_well(SERVICE, lambda counts=counts: _is_found(key, own, counts))


def _is_found(key: str, where: Path, counts: bool) -> None:
    found, warning = stored.load(key, where)
    assert (found is not None) is counts and bool(warning) is not counts


def of_before(state: Path) -> None:
    """As a version before had it: one folder, that both may write."""
    own = own_folder.of(state)
    for path in list(own.iterdir()):
        path.rename(state / path.name)
    own.rmdir()
    for path in (state, *state.rglob("*")):
        os.chown(path, PANEL if path.name.startswith(("store", "log_in")) else SERVICE, GROUP)
        path.chmod(0o2770 if path.is_dir() else 0o660)


def test_a_folder_of_before_is_parted_by_root_and_not_by_the_panel(state: Path) -> None:
    of_before(state)
    victim = state.parent / "etc" / "kept"
    (state / "programs" / "planted.ngc").symlink_to(victim)
    os.link(victim, state / "programs" / "linked.ngc")
    (state / "runs" / "planted").symlink_to(victim.parent)
    state.chmod(0o750)  # as tmpfiles does first

    def opens() -> None:
        with pytest.raises(StoreError):
            Store(state)

    assert ends_well(PANEL, opens)
    own = own_folder.of(state)
    own.mkdir()
    os.chown(own, PANEL, GROUP)
    own_folder.part(state)
    assert victim.stat().st_uid == victim.parent.stat().st_uid == 0 and victim.read_text() == "root's"
    for path in (state, *state.rglob("*")):
        facts = path.lstat()
        if path.is_dir() and not path.is_symlink():
            assert not facts.st_mode & 0o022, path
            assert facts.st_uid == (PANEL if path.is_relative_to(own) else SERVICE), path
    assert (own / "store.sqlite").stat().st_uid == PANEL

    def reads() -> None:
        with contextlib.closing(Store(state)) as store:
            assert [one.name for one in store.programs.list()] == ["a.ngc"]
            assert [one.name for one in store.users.all()] == ["anna"] and store.users.lost is None

    assert ends_well(PANEL, reads)


@pytest.mark.parametrize("done", [0, 1, 2])
def test_an_interrupted_parting_is_gone_on_with_and_opens_nothing(state: Path, done: int) -> None:
    of_before(state)
    own = own_folder.of(state)
    own.mkdir()
    for name in ("log_in", "programs")[:done]:
        (state / name).rename(own / name)
    with contextlib.closing(Store(state)) as store:
        assert [one.name for one in store.programs.list()] == ["a.ngc"]
        assert [one.name for one in store.users.all()] == ["anna"] and store.users.lost is None
    assert not {"store.sqlite", "log_in", "programs"} & {*os.listdir(state)}


def test_no_file_is_loaded_for_whom_may_not_read_it(state: Path) -> None:
    """Not by its path, by a link, nor as a sub: a refusal would say what is in it."""
    own, secret = own_folder.of(state), state.parent / "etc" / "kept"
    (shared := state.parent / "etc" / "shared.ngc").write_bytes(b"(of anybody)\nM30\n")
    secret.chmod(0o640)
    (own / "link.ngc").symlink_to(secret)
    (own / "main.ngc").write_bytes(b"o<kept> call\nM30\n")
    os.chown(own / "main.ngc", PANEL, GROUP)

    def asked(name: str, reader: int, **files: str) -> bytes:
        values = {"path": str(own / name), "files": files, jobs.READER: reader}
        return bytes(jobs.read(values, shipped()).program.text)

    assert asked(str(shared), PANEL) == shared.read_bytes()
    for name, files in (
        (str(secret), {}),
        ("link.ngc", {}),
        ("main.ngc", {"kept": str(secret)}),
        ("/proc/self/maps", {}),
    ):
        with pytest.raises(CommandRefused) as refused:
            asked(name, PANEL, **files)
        assert refused.value.said["key"] == "unreadable"
    assert all(b"root's" in asked(name, 0) for name in (str(secret), "link.ngc"))
    shared.parent.chmod(0o750)
    with pytest.raises(CommandRefused):
        asked(str(shared), PANEL)
    assert asked("main.ngc", PANEL) == (own / "main.ngc").read_bytes()
