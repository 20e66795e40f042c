"""What the page has of others: fetched anew by its version, and held to its checksums.

    python -m controller.web.vendor             # whether every file is as the manifest says
    python -m controller.web.vendor --refresh   # fetch the manifest's versions, with npm

To take another version, change it in ``static/vendor/manifest.json`` and refresh. Neither users nor tests
need npm. The files are as their makers publish them, but for the names of what they import.
"""

import hashlib
import json
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterator
from pathlib import Path

from controller.web.files import STATIC

FOLDER = STATIC / "vendor"
MANIFEST = FOLDER / "manifest.json"


def changed() -> Iterator[str]:
    """A sentence for every file that is not as the manifest says, or that it does not name."""
    packages = json.loads(MANIFEST.read_text())["packages"]
    named = {file["name"]: file["sha256"] for package in packages for file in package["files"]}
    for path in {FOLDER / name for name in named} | {*FOLDER.iterdir()} - {MANIFEST}:
        if path.name not in named:
            yield f"{path}: the manifest does not name it; name it there or delete it."
        elif not path.is_file() or hashlib.sha256(path.read_bytes()).hexdigest() != named[path.name]:
            yield f"{path}: is not the file of the manifest; fetch it anew with --refresh."


def refresh() -> None:
    """Fetch all that the manifest names, and write the checksums of what came."""
    manifest = json.loads(MANIFEST.read_text())
    for package in manifest["packages"]:
        with tempfile.TemporaryDirectory() as folder:
            fetch = ["npm", "pack", "--silent", f"{package['name']}@{package['version']}"]
            subprocess.run(fetch, cwd=folder, check=True, stdout=subprocess.DEVNULL)
            (archive,) = Path(folder).iterdir()
            with tarfile.open(archive) as packed:
                packed.extractall(folder, filter="data")
            for file in package["files"]:
                body = (Path(folder) / "package" / file["from"]).read_bytes()
                for told, here in file.get("imports", {}).items():
                    body = body.replace(told.encode(), here.encode())
                (FOLDER / file["name"]).write_bytes(body)
                file["sha256"] = hashlib.sha256(body).hexdigest()
    MANIFEST.write_text(json.dumps(manifest, indent=2) + "\n")


if __name__ == "__main__":
    if "--refresh" in sys.argv[1:]:
        refresh()
    found = sorted(changed())
    print("\n".join(found) or "All files are as the manifest says.")
    sys.exit(bool(found))
