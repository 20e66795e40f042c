"""The files of the page, packed once and told by their content: a browser has each of them only once."""

from __future__ import annotations

import functools
import gzip
import hashlib
import mimetypes
import posixpath
import re
from pathlib import Path
from typing import NamedTuple

from starlette.requests import Request
from starlette.responses import Response

STATIC = Path(__file__).parent / "static"
KINDS = {".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml", ".txt": "text/plain"}
MIN_PACKED_BYTES = 500  # bytes that are worth packing
_IMPORTED = re.compile(r'^(?:import|export)\b[^"]*"(\.{1,2}/[^"]+)";?$', re.MULTILINE)  # of a module, at once


class Packed(NamedTuple):
    """A file as it is sent."""

    body: bytes
    packed: bytes
    kind: str
    tag: str

    @classmethod
    def of(cls, body: bytes, kind: str) -> Packed:
        return cls(body, gzip.compress(body, mtime=0), kind, f'"{hashlib.sha256(body).hexdigest()[:24]}"')

    def answer(self, request: Request) -> Response:
        """Packed where the browser takes that, and nothing where it has it already."""
        headers = {"ETag": self.tag, "Cache-Control": "no-cache", "Vary": "Accept-Encoding"}
        if request.headers.get("if-none-match") == self.tag:
            return Response(status_code=304, headers=headers)
        packs = "gzip" in request.headers.get("accept-encoding", "") and len(self.body) > MIN_PACKED_BYTES
        if packs:
            headers["Content-Encoding"] = "gzip"
        return Response(self.packed if packs else self.body, headers=headers, media_type=self.kind)


@functools.cache
def names() -> frozenset[str]:
    """Of all files, with their folders: ``views/run.js``."""
    return frozenset(str(file.relative_to(STATIC)) for file in STATIC.rglob("*") if file.is_file())


def file(name: str) -> Packed:
    """One of ``names``; read anew where it was changed."""
    path = STATIC / name
    return _read(path, path.stat().st_mtime_ns)


def modules_of(script: str) -> list[str]:
    """A module and all that it imports, and they: a browser that is told of them asks for all at once."""
    found, ahead = dict[str, None](), [script]
    while ahead:
        name = ahead.pop()
        if name not in found:
            found[name] = None
            folder, text = posixpath.dirname(name), file(name).body.decode()
            ahead += [posixpath.normpath(posixpath.join(folder, one)) for one in _IMPORTED.findall(text)]
    return list(found)


@functools.lru_cache(maxsize=200)
def _read(path: Path, _: int) -> Packed:
    kind = KINDS.get(path.suffix) or mimetypes.guess_type(path.name)[0] or "application/octet-stream"
    return Packed.of(path.read_bytes(), kind)
