"""What means harm or had bad luck, for tests: names, forms and requests; and a look that a store is whole."""

from __future__ import annotations

import hashlib
import os
import random
import string
from typing import NamedTuple

from controller.api import names
from controller.api.store import Store
from controller.own_database import BESIDE
from controller.store.service_store import FILE

TEXT = b"G1 X10 F100\nM2\n"
CONTENT_TYPE = "multipart/form-data; boundary=frontier"

HOSTILE_NAMES = [
    "../part.ngc",
    "../../etc/passwd",
    "/etc/passwd",
    "..",
    ".",
    "",
    " ",
    ".hidden",
    "..\\..\\windows\\win.ini",
    "C:/part.ngc",
    "part\x00.ngc",
    "part.ngc\x00.png",
    "part\n.ngc",
    "part\r\nX-Header: 1",
    "a" * 5000,
    "ü" * 119,
    "\u202egpj.ngc",  # turns the direction of what follows
    "part\u200b.ngc",
    "part\udcff.ngc",
    "-rf",
    "part.",
    "part ",
    "part/../../x",
    "a//b",
    "a/",
    "a/./b",
    "a/.hidden",
    "a/-rf",
    "a/b /c",
    "1/2/3/4/5/6/7/8/9/10",
    "a|b",
    "$(reboot)<script>",
    "\u2028",
    "\uffff",
]
SOUND_NAMES = [
    *("part.ngc", "Teil für Änderung (2).ngc", "O1234", "部品.ngc", "a" * 120, "x'y`z$;&.nc", "a..b"),
    *("programs/part.ngc", "Spannmittel/links/Teil 2.ngc", "%2e%2e/part", "50%/a%2Fb.ngc", "x/text"),
]


class Sent(NamedTuple):
    """A body, in chunks, with its content type; ``cut`` = its sender goes away after that many bytes."""

    body: bytes
    content_type: str = CONTENT_TYPE
    cut: int | None = None
    pause_s: float = 0.0
    chunk: int = 4096


def form(name: str, text: bytes = TEXT, /, **fields: str) -> bytes:
    shown = name.encode("utf-8", "surrogateescape").replace(b"\\", b"\\\\").replace(b'"', b'\\"')
    parts = [
        b'--frontier\r\ncontent-disposition: form-data; name="%s"\r\n\r\n%s\r\n'
        % (key.encode(), value.encode("utf-8", "surrogateescape"))
        for key, value in fields.items()
    ]
    file = b'--frontier\r\ncontent-disposition: form-data; name="file"; filename="%s"\r\n\r\n%s\r\n'
    return b"".join([*parts, file % (shown, text), b"--frontier--\r\n"])


def assert_whole(store: Store) -> None:
    """Nothing beside the store, and in it names and contents in step."""
    assert os.listdir(store.folder.parent) == [store.folder.name]
    assert set(os.listdir(store.folder)) <= {store.own.name, *(FILE + end for end in ("", *BESIDE))}
    top = {p.name for p in store.own.iterdir()}
    database = {"store.sqlite" + end for end in ("", *BESIDE)}
    assert top <= {"programs", "log_in", *database}
    listed = store.programs.list()
    files = {p.name for p in store.programs.folder.iterdir()} - {".incoming"}
    assert files == {f"{program.sha256}.ngc" for program in listed}
    for program in listed:
        assert names.check(program.name) == program.name
        content = store.programs.path(program.sha256).read_bytes()
        assert hashlib.sha256(content).hexdigest() == program.sha256
        assert len(content) == program.size
    assert not list(store.programs.incoming.iterdir())


def an_upload(draw: random.Random) -> Sent:
    """A form with none to three things wrong."""
    body = form(a_name(draw), _a_text(draw), **_some_fields(draw))
    kind = draw.randrange(8)
    if kind == 0:
        body = body[: draw.randrange(len(body))]
    elif kind == 1:
        at = draw.randrange(len(body))
        body = body[:at] + draw.randbytes(draw.randrange(1, 9)) + body[at + draw.randrange(9) :]
    elif kind == 2:
        body = draw.randbytes(draw.randrange(3000))
    elif kind == 3:
        body = body.replace(b"\r\n", draw.choice([b"\n", b"\r", b"\r\r\n"]), draw.randrange(1, 9))
    cut = draw.randrange(len(body) + 1) if draw.random() < 0.1 else None
    return Sent(body, cut=cut, chunk=draw.choice([7, 100, 4096]))


def a_name(draw: random.Random) -> str:
    """One in four is sound: behind a wrong one nothing else of what is sent is looked at."""
    kind = draw.random()
    if kind < 0.25:
        return draw.choice([*SOUND_NAMES, "p1", "p2", "p3"])
    if kind < 0.45:
        return draw.choice(HOSTILE_NAMES)
    letters = string.ascii_letters + "./\\ \x00\"';%\n\r\t:*?<>|é\u202e\udc80\U0001f600"
    return "".join(draw.choices(letters, k=draw.randrange(1, 40)))


def _a_text(draw: random.Random) -> bytes:
    return draw.choice(
        [TEXT, b"", draw.randbytes(50), b"--frontier", b"\r\n--frontier--\r\n", b"G4 P1\n" * 5000]
    )


def _some_fields(draw: random.Random) -> dict[str, str]:
    fields = {}
    if draw.random() < 0.3:
        fields["sha256"] = draw.choice([hashlib.sha256(TEXT).hexdigest(), "0" * 64, "no", "\x00", "é" * 64])
    if draw.random() < 0.2:
        fields["size"] = draw.choice([str(len(TEXT)), "0", "9" * 30, "²", "1e3"])
    if draw.random() < 0.2:
        fields["name"] = a_name(draw)
    return fields
