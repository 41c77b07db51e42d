"""Installed packages: versions of distributions, and of packages of npm, for engines that run in Node.js; and where the latter are."""

import json
import re
import sys
from functools import cache
from importlib import metadata
from importlib.metadata import PackageNotFoundError
from pathlib import Path

Version = tuple[int, ...]

RAPIER_JS = "@dimforge/rapier3d-compat"
CANNON_ES, JOLT, HAVOK = "cannon-es", "jolt-physics", "@babylonjs/havok"
UNSCOPED = frozenset({CANNON_ES, JOLT})
"""Packages of npm whose names have no scope."""

_distribution_version = cache(metadata.version)
"""Cached, because each query parses its metadata."""


def version(package: str) -> str:
    """The installed version of a distribution, or of a package of npm.

    Raises:
        PackageNotFoundError: It is not installed.
    """
    if not is_npm(package):
        return _distribution_version(package)
    described: dict[str, str] = json.loads((npm_package(package) / "package.json").read_text(encoding="utf-8"))
    return described["version"]


def install_extra(name: str) -> str:
    """The command that installs the packages of an extra of dropspin, which need not be on an index itself."""
    parts = [text.split("; extra == ") for text in metadata.requires("dropspin") or ()]
    return " ".join(["pip install", *(f"'{package}'" for package, *extra in parts if extra == [f"'{name}'"])])


def numbers_of(text: str) -> Version:
    """The first three numbers of a version string; a suffix such as .dev1 comes after them."""
    return tuple(map(int, re.findall(r"\d+", text)[:3]))


def formatted(version: Version) -> str:
    """The version as a string, such as 3.8.1."""
    return ".".join(map(str, version))


def is_npm(package: str) -> bool:
    """Whether a package is one of npm: its name has a scope, as in `@dimforge/rapier3d-compat`, or is known."""
    return package.startswith("@") or package in UNSCOPED


def npm_package(package: str) -> Path:
    """The folder of a package, in the environment of Python, else where Node.js finds it from the working directory.

    So `npm install --prefix ENVIRONMENT PACKAGE` belongs to an environment as what pip installs there does.

    Raises:
        PackageNotFoundError: It is not installed.
    """
    here = Path.cwd()
    for folder in (Path(sys.prefix), here, *here.parents):
        if (folder / "node_modules" / package / "package.json").is_file():
            return folder / "node_modules" / package
    raise PackageNotFoundError(package)
