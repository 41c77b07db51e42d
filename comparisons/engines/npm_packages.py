"""Packages of npm, for engines that run in Node.js: where they are, and their versions."""

import json
import sys
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError
from pathlib import Path


def is_npm(package: str) -> bool:
    """Whether a package is one of npm: the names of those that engines use have a scope, as in `@dimforge/rapier3d-compat`."""
    return package.startswith("@")


def npm_package(package: str) -> Path:
    """The folder of a package, in the environment of Python, else where Node.js finds it from the working directory.

    So `npm install --prefix ENVIRONMENT PACKAGE` belongs to an environment as what pip installs there does.

    Raises:
        PackageNotFoundError: It is not installed.
    """
    found = next((folder for folder in _folders(package) if (folder / "package.json").is_file()), None)
    if found is None:
        raise PackageNotFoundError(package)
    return found


def npm_version(package: str) -> str:
    """The version of a package; errors are those of `npm_package`."""
    version: str = json.loads((npm_package(package) / "package.json").read_text(encoding="utf-8"))["version"]
    return version


def _folders(package: str) -> Iterator[Path]:
    here = Path.cwd()
    for folder in (Path(sys.prefix), here, *here.parents):
        yield folder / "node_modules" / package
