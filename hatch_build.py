"""Compiles the hot rooms at installation, where it is asked for: DIRECTRIX_COMPILE=1 pip install ...

The same source runs compiled (by mypyc, from its own type annotations) and not, with the same setpoints
to the last bit. Which modules: [tool.hatch.build.targets.wheel.hooks.custom] of pyproject.toml. In an
editable installation the libraries lie beside their source, and an installation without the variable
takes them away again. Needs a C compiler and Python's headers (Debian: gcc python3-dev).
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

GROUP = "directrix"  # all modules are in one library; each has a small one that leads to it
SETUP = """
from mypyc.build import mypycify
from setuptools import setup
extensions = mypycify([{flags}, *{modules}], opt_level="2", group_name="{group}")
extensions[0].extra_compile_args.append("-ffp-contract=off")  # a * b + c rounds twice, as in Python
setup(name="{group}", packages=[], ext_modules=extensions)
"""
WITHOUT = "The hot rooms cannot be compiled; without DIRECTRIX_COMPILE all works, too."
# What the modules import from others, but for numpy, is not there in this build, and not looked into.
FLAGS = '"--config-file=", "--ignore-missing-imports", "--no-warn-no-return"'


class CompileHook(BuildHookInterface[Any]):
    """Of wheels, the editable one among them."""

    def dependencies(self) -> list[str]:
        return ["mypy>=2.3,<3", "setuptools>=68", "numpy>=2"] if _asked() else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        root, editable = Path(self.root), version == "editable"
        if editable:
            _take_away(root)
        if not _asked():
            return
        made = _compiled(root, Path(tempfile.mkdtemp()), self.config["modules"])
        for library in made.rglob("*.so"):
            place = str(library.relative_to(made))
            if editable:
                shutil.copy(library, root / place)
            else:
                build_data["force_include"][str(library)] = place
        build_data["pure_python"], build_data["infer_tag"] = editable, not editable


def _asked() -> bool:
    return os.environ.get("DIRECTRIX_COMPILE", "0") not in ("", "0")


def _take_away(root: Path) -> None:
    for pattern in (f"{GROUP}__mypyc.*.so", "controller/**/*.so", "drives/**/*.so"):
        for library in root.glob(pattern):
            library.unlink()


def _compiled(root: Path, folder: Path, modules: list[str]) -> Path:
    """The folder with the libraries, laid out as in a wheel."""
    for package in ("controller", "drives"):
        (folder / package).symlink_to(root / package)
    (folder / "setup.py").write_text(SETUP.format(flags=FLAGS, modules=modules, group=GROUP))
    done = subprocess.run(
        [sys.executable, "setup.py", "-q", "build_ext", "--build-lib", "made"],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    if done.returncode:
        raise RuntimeError(f"{done.stdout}\n{WITHOUT}")
    return folder / "made"
