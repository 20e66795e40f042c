"""A program out of a multipart form, straight into the store's temporary file.

    received = await multipart.receive(request.stream(), content_type, store.uploads, by)
    received.program, received.fields["print"], ...

Nothing is kept in memory or in other temporary files, whatever the size. The form ends with
its closing boundary or was cut off: then, as with every other mistake, nothing is kept.
A file may come with the fields ``sha256`` (or ``checksum``), ``size`` and ``name`` (instead of the file
name); they may come before or after it.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import AsyncIterator, Callable, Collection
from dataclasses import dataclass, field
from email.message import Message
from functools import partial

from python_multipart.exceptions import FormParserError
from python_multipart.multipart import MultipartParser, parse_options_header

from controller.api import names
from controller.api.database import StoreError
from controller.api.programs import Program
from controller.api.uploads import Upload, Uploads
from controller.messages import Key, message

logging.getLogger("python_multipart").setLevel(logging.ERROR)  # what is sent wrong is answered to its sender

MAX_FIELDS = 16
MAX_FIELD_BYTES = 1024
SEND = Key("upload.send")


@dataclass(frozen=True, slots=True)
class Received:
    """What a form brought."""

    program: Program
    fields: dict[str, str]


@dataclass(slots=True)
class _Part:
    """One part of a form: a field, or (with a file name) the file."""

    headers: list[tuple[bytes, bytes]] = field(default_factory=list)
    name: str = ""
    file_name: str | None = None
    text: bytearray = field(default_factory=bytearray)


async def receive(
    chunks: AsyncIterator[bytes],
    content_type: str,
    uploads: Uploads,
    by: str = "",
    in_use: Callable[[], Collection[str]] = tuple,
) -> Received:
    """Read a form to its end and keep its program; ``in_use`` is asked at the end, and by the thread.

    Raises StoreError: form, slow, and those of ``Upload``; what ``chunks`` raises keeps nothing either.
    """
    form = _Form(content_type, uploads, by)
    try:
        began_s = time.monotonic()
        while (chunk := await _next(chunks, began_s, form.taken, uploads)) is not None:
            await asyncio.to_thread(form.feed, chunk)
        return await asyncio.to_thread(form.finish, in_use)
    finally:
        form.close()


async def _next(chunks: AsyncIterator[bytes], began_s: float, taken: int, uploads: Uploads) -> bytes | None:
    """The next chunk, if it comes before the slowest pace allowed says."""
    limits = uploads.limits
    left_s = began_s + limits.patience_s + taken / limits.slowest_bytes_s - time.monotonic()
    try:
        return await asyncio.wait_for(anext(chunks, None), max(left_s, 0.001))
    except TimeoutError as error:
        pace = {"pause": limits.patience_s, "pace": limits.slowest_bytes_s}
        raise StoreError.of("slow", "upload_slow", **pace) from error


class _Form:
    """Takes the bytes of a form; runs in one thread at a time."""

    def __init__(self, content_type: str, uploads: Uploads, by: str) -> None:
        self._uploads, self._by = uploads, by
        self._open = contextlib.ExitStack()
        self._upload: Upload | None = None
        self._fields: dict[str, str] = {}
        self._part = _Part()
        self._header = (bytearray(), bytearray())
        self._ended = False
        self._parser = self._made(content_type)
        self.taken = 0

    def feed(self, chunk: bytes) -> None:
        self.taken += len(chunk)
        most = self._uploads.limits.most_bytes
        if self.taken > most + MAX_FIELDS * (MAX_FIELD_BYTES + 4096):
            raise StoreError.of("size", "upload_beyond", most=most)
        try:
            self._parser.write(chunk)
        except FormParserError as error:
            raise StoreError("form", message("upload.no_form", why=error, send=SEND)) from error

    def finish(self, in_use: Callable[[], Collection[str]]) -> Received:
        if not self._ended:
            raise StoreError.of("form", "upload_cut")
        if self._upload is None:
            raise StoreError("form", message("upload.no_file", send=SEND))
        self._upload.named(self._fields.get("name"), _size(self._fields))
        sha256 = self._fields.get("sha256") or self._fields.get("checksum")
        return Received(self._upload.commit(in_use(), sha256), self._fields)

    def close(self) -> None:
        self._open.close()

    def _made(self, content_type: str) -> MultipartParser:
        kind, options = parse_options_header(content_type)
        if kind != b"multipart/form-data" or not options.get(b"boundary"):
            raise StoreError(
                "form", message("upload.content_type", found=names.shown(content_type), send=SEND)
            )
        try:
            return MultipartParser(
                options[b"boundary"],
                {
                    "on_part_begin": self._begin,
                    "on_header_field": partial(self._collect, 0),
                    "on_header_value": partial(self._collect, 1),
                    "on_header_end": self._header_end,
                    "on_headers_finished": self._headers_end,
                    "on_part_data": self._data,
                    "on_part_end": self._end,
                    "on_end": self._all,
                },
            )
        except FormParserError as error:
            raise StoreError("form", message("upload.wrong", why=error, send=SEND)) from error

    # ---- called by the parser, in its order

    def _begin(self) -> None:
        if len(self._fields) >= MAX_FIELDS:
            raise StoreError("form", message("upload.fields", max_fields=MAX_FIELDS, send=SEND))
        self._part = _Part()

    def _collect(self, which: int, data: bytes, start: int, end: int) -> None:
        self._header[which].extend(data[start:end])

    def _header_end(self) -> None:
        self._part.headers.append((bytes(self._header[0]).lower(), bytes(self._header[1])))
        self._header = (bytearray(), bytearray())

    def _headers_end(self) -> None:
        self._part.name, self._part.file_name = _names(self._part.headers)
        if self._part.file_name is None:
            return
        if self._upload is not None:
            raise StoreError("form", message("upload.files", send=SEND))
        # A ``name`` that came before the file counts instead of the file's own.
        name = self._fields.get("name") or self._part.file_name
        self._upload = self._open.enter_context(self._uploads.begin(name, by=self._by))

    def _data(self, data: bytes, start: int, end: int) -> None:
        if self._part.file_name is not None and self._upload is not None:
            self._upload.write(data[start:end])
            return
        self._part.text += data[start:end]
        if len(self._part.text) > MAX_FIELD_BYTES:
            raise StoreError("form", message("upload.field_long", max_field_bytes=MAX_FIELD_BYTES, send=SEND))

    def _end(self) -> None:
        if self._part.file_name is None:
            self._fields[self._part.name] = self._part.text.decode("utf-8", "replace")

    def _all(self) -> None:
        self._ended = True


def _names(headers: list[tuple[bytes, bytes]]) -> tuple[str, str | None]:
    """(name of the field, name of the file or None); browsers send UTF-8 as it is."""
    value = next((value for key, value in headers if key == b"content-disposition"), b"")
    kind, options = parse_options_header(value)
    if kind != b"form-data" or b"name" not in options:
        raise StoreError("form", message("upload.no_field", send=SEND))
    field_name = options[b"name"].decode("utf-8", "replace")
    if b"filename" in options:
        return field_name, options[b"filename"].decode("utf-8", "replace")
    return field_name, _extended(value) if b"filename*" in value else None


def _extended(value: bytes) -> str | None:
    """The file name of a sender that only writes the extended form, ``filename*=utf-8''...``."""
    header = Message()
    header["Content-Disposition"] = value.decode("latin-1")
    return header.get_filename()


def _size(fields: dict[str, str]) -> int | None:
    if "size" not in fields:
        return None
    if not fields["size"].isascii() or not fields["size"].isdigit():
        raise StoreError("form", message("upload.size", found=names.shown(fields["size"])))
    return int(fields["size"])
