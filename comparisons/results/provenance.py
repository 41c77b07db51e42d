"""Provenance of results: versions, machine, commit, time."""

import hashlib
import json
import os
import platform
import subprocess
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from datetime import UTC, datetime
from email import message_from_string
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

import numpy as np

from dropspin.comparisons.engines.packages import version
from dropspin.comparisons.engines.registry import DISTRIBUTIONS, parsed
from dropspin.scenarios import Trajectory
from dropspin.scenarios.text import printable

MEASURING = ("dropspin", "numpy", "numba", "scipy")
STAMPED = (*MEASURING, *DISTRIBUTIONS)
PACKAGES = tuple(Path(__file__).parents[2] / package for package in ("scenarios", "reference_impl", "comparisons"))
"""The packages that results depend on; the reports only show them."""


def provenance(asked: Mapping[str, Any]) -> dict[str, Any]:
    """Where and when a run started, and what it was asked for."""
    return {
        "asked": dict(asked),
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": versions(),
        "wheels": {package: tag for package in STAMPED if (tag := _of_package(_wheel, package))},
        "python": platform.python_version(),
        "platform": platform.platform(),
        "cpu": processor(),
        "cores": os.cpu_count(),
        "commit": _commit(),
        "code": code(*PACKAGES),
    }


def versions() -> dict[str, str | None]:
    """Installed versions of the packages that results depend on; None where one is missing."""
    return {package: _of_package(version, package) for package in STAMPED}


def versions_behind(stamp: Mapping[str, Any]) -> dict[str, str]:
    """The versions that a run's results depend on: of the packages that measured them, and of the engines as they report it."""
    engines = {parsed(label)[0]: settings.get("version") for label, settings in first_settings(stamp).items()}
    engines.pop("wang", None)  # part of dropspin
    packages = {package: stamp["versions"][package] for package in MEASURING}
    return {name: printable(str(found)) for name, found in (packages | engines | {"python": stamp["python"]}).items() if found}


def first_settings(stamp: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Each engine's settings in the first scene it ran."""
    return {label: next(iter(stamped.values())) for label, stamped in stamp["settings"].items() if stamped}


def processor() -> str:
    """The processor's name, as far as the system gives it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    named = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else platform.machine()


def _of_package(read: Callable[[str], str], package: str) -> str | None:
    """What is known of an installed package; None if it is missing."""
    with suppress(PackageNotFoundError):
        return read(package)
    return None


def _wheel(package: str) -> str:
    """What a package was built for, such as cp311-cp311-manylinux_2_28_x86_64; empty if that is not known."""
    return ", ".join(message_from_string(distribution(package).read_text("WHEEL") or "").get_all("Tag", []))


def code(*places: Path) -> str:
    """A short hash of the Python files at some places; it shows changes that no version number shows."""
    files = sorted(file for place in places for file in (place.rglob("*.py") if place.is_dir() else [place]))
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:12]


def motion_digest(motions: Iterable[Trajectory]) -> str:
    """A short hash of motions: equal hashes mean motions that are equal bit for bit."""
    found = hashlib.sha256()
    for motion in motions:
        found.update(np.ascontiguousarray(motion.states, dtype=np.float64).tobytes())
        found.update(np.float64(motion.velocity_lag).tobytes())
    return found.hexdigest()[:8]


def digest(settings: Mapping[str, Any]) -> str:
    """A short hash of settings: equal hashes mean equal settings."""
    return hashlib.sha256(json.dumps(settings, sort_keys=True, default=str).encode()).hexdigest()[:12]


def _commit() -> str | None:
    """The commit of the working directory, which is the user's own repository as often as not."""
    try:
        answer = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, timeout=5, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return answer.stdout.strip() or None
