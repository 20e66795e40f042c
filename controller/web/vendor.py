"""What the page has of others: fetched anew by its version, and held to its checksums.

    python -m controller.web.vendor             # whether every file is as the manifest says
    python -m controller.web.vendor --refresh   # fetch the manifest's versions, with npm

To take another version, change it in ``static/vendor/manifest.json`` and refresh. Neither users nor tests
need npm. The files are as their makers publish them, but for the names of what they import.
"""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from controller.web.files import STATIC

FOLDER = STATIC / "vendor"
MANIFEST = FOLDER / "manifest.json"


def packages() -> list[dict[str, Any]]:
    """Of the manifest: name, version, licence, and of each file its checksum and where it is from."""
    found: list[dict[str, Any]] = json.loads(MANIFEST.read_text())["packages"]
    return found


def changed() -> Iterator[str]:
    """A sentence for every file that is not as the manifest says, or that it does not name."""
    named = {file["name"]: file["sha256"] for package in packages() for file in package["files"]}
    for name, sha256 in named.items():
        path = FOLDER / name
        if not path.is_file() or _sum(path.read_bytes()) != sha256:
            yield f"{path}: is not the file of the manifest; fetch it anew with --refresh."
    for path in FOLDER.iterdir():
        if path.name not in named and path != MANIFEST:
            yield f"{path}: the manifest does not name it; name it there or delete it."


def refresh() -> None:
    """Fetch all that the manifest names, and write the checksums of what came."""
    fetched = packages()
    for package in fetched:
        with tempfile.TemporaryDirectory() as folder:
            wanted = f"{package['name']}@{package['version']}"
            subprocess.run(
                ["npm", "pack", "--silent", wanted], cwd=folder, check=True, stdout=subprocess.DEVNULL
            )
            (archive,) = Path(folder).iterdir()
            with tarfile.open(archive) as packed:
                for file in package["files"]:
                    file["sha256"] = _take(packed, file)
    MANIFEST.write_text(json.dumps({"packages": fetched}, indent=2) + "\n")


def _take(packed: tarfile.TarFile, file: dict[str, Any]) -> str:
    """Write one file; its checksum."""
    member = packed.extractfile(f"package/{file['from']}")
    assert member is not None
    body = member.read()
    for told, here in file.get("imports", {}).items():
        body = body.replace(told.encode(), here.encode())
    (FOLDER / file["name"]).write_bytes(body)
    return _sum(body)


def _sum(body: bytes) -> str:
    return hashlib.sha256(body).hexdigest()


def main() -> None:
    """Tell what is changed, and end with 1 where anything is."""
    if "--refresh" in sys.argv[1:]:
        refresh()
    found = list(changed())
    print("\n".join(found) or "All files are as the manifest says.")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
