"""What an installation is made of: the lock of its packages, and the list of them all (SBOM).

``requirements.lock`` beside the units names a version of every package that the services take, with the
SHA-256 of each file of it: ``pip install --require-hashes -r requirements.lock`` takes no other. Made anew by

    uv pip compile --universal --generate-hashes --python-version 3.11 --no-header --no-annotate
        --extra panel --extra modbus pyproject.toml -o systemd/requirements.lock
"""

from __future__ import annotations

import json
import platform
import re
import uuid
from collections.abc import Iterator
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from controller import atomic_file
from controller.cli import installation
from controller.verify.console import refusals, say, show
from controller.version import VERSION

LOCK = "requirements.lock"
NAME = "directrix"
MANIFEST = Path(__file__).parent.parent / "web" / "static" / "vendor" / "manifest.json"
_PACKAGE = r"^(?P<name>[\w.-]+)==(?P<version>[^\s;]+)(?: ; (?P<marker>.*?))? \\\n"
_LINE = re.compile(_PACKAGE + r"(?P<sums>(?: .*\n?)+)", re.MULTILINE)


class Locked(NamedTuple):
    """A package of the lock."""

    name: str
    version: str
    sums: tuple[str, ...]  # SHA-256 of its files


def locked(text: str) -> dict[str, Locked]:
    """The packages of a lock that this computer takes, by their names. Raises ValueError for no lock."""
    from packaging.markers import Marker

    found = {}
    for one in _LINE.finditer(text):
        if one["marker"] is None or Marker(one["marker"]).evaluate():
            sums = tuple(re.findall(r"--hash=sha256:([0-9a-f]{64})", one["sums"]))
            found[plain_name(one["name"])] = Locked(one["name"], one["version"], sums)
    if not found:
        raise ValueError(LOCK)
    return found


def shipped() -> Path:
    """The lock of this version."""
    return installation.shipped() / LOCK


def plain_name(name: str) -> str:
    """As packages are compared (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


def others() -> list[str]:
    """Packages that this environment has not, or in another version than the lock. Raises OSError."""
    there = {plain_name(one.name): one.version for one in metadata.distributions()}
    packages = locked(shipped().read_text()).items()
    return [
        f"{one.name} {there.get(name, '–')} ({one.version})"
        for name, one in packages
        if there.get(name) != one.version
    ]


# -- the list of all that is there


def sbom(output: Annotated[Path | None, typer.Argument()] = None) -> None:
    """List all packages of this installation, as CycloneDX (JSON); to a file, or printed."""
    with refusals(False):
        text = json.dumps(bill(), indent=1) + "\n"
        if output is None:
            print(text, end="")
            return
        atomic_file.write(output.absolute(), text)
        show.print(say("cli.service.sbom", output=output))


def bill() -> dict[str, Any]:
    """CycloneDX 1.6: of Directrix, of what it needs as far as that is installed, and of what the page has."""
    needed = _closure()
    lock = locked(shipped().read_text())
    packages = [_package(name, lock.get(name)) for name in sorted(needed) if name != NAME]
    own = _component("application", NAME, VERSION, _ref(NAME, VERSION))
    refs = {name: _ref(name, _version(name)) for name in needed}
    links = [
        {"ref": refs[name], "dependsOn": sorted(refs[one] for one in needs)} for name, needs in needed.items()
    ]
    version = platform.python_version()
    python = _component("platform", "python", version, f"python@{version}")
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "serialNumber": f"urn:uuid:{uuid.uuid4()}",
        "version": 1,
        "metadata": {"timestamp": datetime.now(UTC).isoformat(timespec="seconds"), "component": own},
        "components": [*packages, *_of_page(), python],
        "dependencies": links,
    }


def _closure() -> dict[str, set[str]]:
    """What is installed of what Directrix needs, at any remove: of each the names of what it needs itself."""
    from packaging.requirements import InvalidRequirement, Requirement

    there = {plain_name(one.name): one for one in metadata.distributions()}
    found: dict[str, set[str]] = {}
    waiting = [NAME]
    while waiting:
        name = waiting.pop()
        if name in found:
            continue
        found[name] = set()
        for line in (there[name].requires or []) if name in there else [*locked(shipped().read_text())]:
            try:
                need = plain_name(Requirement(line).name)
            except InvalidRequirement:
                continue
            if need in there:
                found[name].add(need)
                waiting.append(need)
    return found


def _version(name: str) -> str:
    return VERSION if name == NAME else metadata.version(name)


def _ref(name: str, version: str) -> str:
    return f"pkg:pypi/{name}@{version}"


def _component(kind: str, name: str, version: str, ref: str) -> dict[str, Any]:
    purl = {"purl": ref} if ref.startswith("pkg:") else {}
    return {"type": kind, "bom-ref": ref, "name": name, "version": version, **purl}


def _package(name: str, lock: Locked | None) -> dict[str, Any]:
    facts, version = metadata.metadata(name).json, _version(name)
    licence = str(facts.get("license_expression") or facts.get("license") or "").strip().split("\n")[0]
    said = {"licenses": [{"license": {"name": licence}}]} if licence else {}
    as_locked = lock is not None and lock.version == version
    sums = lock.sums if lock is not None and as_locked else ()
    properties = [
        {"name": "directrix:locked", "value": str(as_locked).lower()},
        *({"name": "directrix:sha256", "value": one} for one in sums),
    ]
    return {**_component("library", name, version, _ref(name, version)), **said, "properties": properties}


def _of_page() -> Iterator[dict[str, Any]]:
    """What is served to browsers of others' work."""
    for package in json.loads(MANIFEST.read_text())["packages"]:
        ref = f"pkg:npm/{package['name'].replace('@', '%40')}@{package['version']}"
        properties = [
            {"name": f"directrix:sha256:{file['name']}", "value": file["sha256"]} for file in package["files"]
        ]
        yield {**_component("library", package["name"], package["version"], ref), "properties": properties}
