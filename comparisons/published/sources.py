"""The published results that dropspin comes with: a TOML file in `data` for each source, with its citation, its scenes and its digits.

The files have numbers and names only; every description is dropspin's own.
"""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import AfterValidator, Field, model_validator

from dropspin.comparisons.published.results import ABSENT, TOLERANCE
from dropspin.scenarios import Scenario
from dropspin.scenarios.errors import verify_known
from dropspin.scenarios.field_types import Table
from dropspin.scenarios.loading import from_mapping, read_toml
from dropspin.scenarios.validation import validated

DATA = Path(__file__).parent / "data"
DIGITS = r"\d+(\.\d+)?(e[-+]?\d+)?"
PRINTED = re.compile(rf"([<>≤] )?-?{DIGITS}|-?{DIGITS}{TOLERANCE}{DIGITS}|{ABSENT}")


def verified_printed(printed: str) -> str:
    """Digits of a number, a bound, a number with a tolerance, or none; `ValueError` for others."""
    if not PRINTED.fullmatch(printed):
        raise ValueError("must be a number such as 3.75 or 5e-3, a bound such as < 1.01, a tolerance such as 0.25±0.0025, or –")
    return printed


class Case(Table):
    """Published values of one run.

    Attributes:
        case: What distinguishes it from the other runs, such as the time step that the source states.
        dt: The time step with which it is run here [s].
        printed: The digits of each quantity, as the source prints them; `< 1.01` for a bound, `0.25±0.0025` for a tolerance that the
            source states, `–` for a value that the source does not have.
    """

    case: str
    dt: float
    printed: tuple[Annotated[str, AfterValidator(verified_printed)], ...]


class Group(Table):
    """Published values of one tool in one scene.

    Attributes:
        tool: The tool that the source describes.
        by: The engine that runs the scene here; empty if there is none.
        why: Why this engine gives these values.
        why_not: Why none can give them here, or why the values of `by` differ; empty for values that are claimed to be reproducible.
        since: The oldest version of the engine that gives these values; empty for any.
        scene: The name of the scene.
        quantities: Names of quantities, as in `quantities.py`.
        cases: The runs.
    """

    tool: str
    by: str = ""
    why: str = ""
    why_not: str = ""
    since: str = ""
    scene: str
    quantities: tuple[str, ...]
    cases: tuple[Case, ...]

    @model_validator(mode="after")
    def _each_quantity_has_digits(self) -> Self:
        for number, case in enumerate(self.cases):
            if len(case.printed) != len(self.quantities):
                wanted = f"one for each of quantities, {list(self.quantities)}"
                raise ValueError(f"cases[{number}].printed: got {list(case.printed)}; must be {wanted}")
        return self


class Source(Table):
    """One source of published results.

    Attributes:
        name: The name of its file.
        title: The subject.
        citation: Authors, title, year.
        place: The file or table, and the version in which it was read.
        licence: The licence of that file.
        setting: The scene and the definitions of the quantities.
        remarks: Sentences on what was found, and on what is left out.
        significant: Number of significant digits of every value, if the source drops trailing zeros; 0 if it does not.
        formula: A function of `formulas.py` that compares the source with an exact solution; empty if there is none.
        data: The folder of measured tosses that a user must have, in words; empty if none is needed.
        parameters: The numbers that the function, or the runs of the tosses, need.
        scenes: The scenes by name, with the keys of a scene's file.
        groups: The values that engines are compared with.
    """

    name: str
    title: str
    citation: str
    place: str
    licence: str
    setting: str
    remarks: tuple[str, ...] = ()
    significant: int = 0
    formula: str = ""
    data: str = ""
    parameters: dict[str, Any] = Field(default_factory=dict)
    scenes: dict[str, dict[str, Any]] = Field(default_factory=dict)
    groups: tuple[Group, ...] = ()

    def scene(self, name: str) -> Scenario:
        """One of the scenes."""
        return from_mapping({"name": name, **self.scenes[name]})


def source_names() -> list[str]:
    """The names of all sources, in the order of their output."""
    return sorted(path.stem for path in DATA.glob("*.toml"))


def sources(names: Iterable[str] = ()) -> list[Source]:
    """The sources of some names; without a name, all that need no data of the user's.

    Raises:
        UnknownName: There is no source of a name.
    """
    known, names = source_names(), list(dict.fromkeys(names))
    chosen = names or known
    verify_known("source", chosen, known)
    loaded = [validated(Source, f"{name}.toml", {"name": name, **read_toml(DATA / f"{name}.toml", name)}) for name in chosen]
    return loaded if names else [source for source in loaded if not source.data]
