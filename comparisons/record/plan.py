"""The plan of the record, `plan.toml`: which releases, engines with options, scenes and time steps it has."""

import json
from collections.abc import Mapping
from pathlib import Path

from pydantic import Field

from dropspin.comparisons.engines.packages import is_npm, numbers_of
from dropspin.comparisons.results.complete_folders import sha256
from dropspin.scenarios import load
from dropspin.scenarios.field_types import Table
from dropspin.scenarios.loading import read_toml

FILE = Path(__file__).with_name("plan.toml")
NUMPY_1 = ["numpy<2", "pandas<3", "pyarrow<26"]
"""pandas 3 and pyarrow 26 need NumPy 2."""


class Releases(Table):
    """The releases of one engine.

    Attributes:
        package: The name on PyPI or npm.
        together: Another package, of which the same release is installed; empty if there is none.
        extra: The extra with which the package is installed; empty for none.
        oldest: The first release to measure.
        numpy_1_until: The last release that was compiled for NumPy 1, which does not work with NumPy 2; empty if all work.
        labels: The engine with each set of options.
        single_precision: Whether its states are in single precision; its adapter says so too, but can be asked where it is installed only.
        scenes: Names of scenes, if they are not those of the plan.
    """

    package: str
    together: str = Field(default="", alias="with")
    extra: str = ""
    oldest: str
    numpy_1_until: str = ""
    labels: tuple[str, ...]
    single_precision: bool = False
    scenes: tuple[str, ...] = ()

    def requirements(self, release: str) -> list[str]:
        """What pip or npm installs for a release."""
        if is_npm(self.package):
            return [f"{self.package}@{release}"]
        extra = f"[{self.extra}]" if self.extra else ""
        chosen = [f"{self.package}{extra}=={release}", *([f"{self.together}=={release}"] if self.together else [])]
        return chosen + (NUMPY_1 if self.numpy_1_until and numbers_of(release) <= numbers_of(self.numpy_1_until) else [])


class Plan(Table):
    """The plan of the record.

    Attributes:
        dts: Time steps [s].
        scenes: Names of scenes in the catalogue.
        engines: The releases of each engine, by its name.
    """

    dts: tuple[float, ...]
    scenes: tuple[str, ...]
    engines: Mapping[str, Releases]

    def scenes_of(self, engine: str) -> tuple[str, ...]:
        """The names of the scenes in which an engine is measured."""
        return self.engines[engine].scenes or self.scenes

    def only(self, engine: str, label: str, scene: str) -> "Plan":
        """The plan of one engine with one set of options in one scene."""
        own = self.engines[engine].model_copy(update={"labels": (label,), "scenes": (scene,)})
        return self.model_copy(update={"engines": {engine: own}})

    def digest(self, engine: str) -> str:
        """A short hash of everything that is measured of each release of an engine."""
        asked = [self.dts, [[name, load(name).digest] for name in self.scenes_of(engine)], self.engines[engine].labels]
        return sha256(json.dumps(asked).encode())[:12]


def load_plan() -> Plan:
    """The plan that dropspin comes with."""
    return Plan.model_validate(read_toml(FILE, FILE.name, "plan"))
