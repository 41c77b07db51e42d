"""The methods by name: which leaf stands at which place of Algorithm 1, and what its module declares about itself."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from reference_impl.contacts import mean, sequential
from reference_impl.corrections import projection
from reference_impl.laws import clamped, coulomb, normal, note, poisson
from reference_impl.rotations import exact, gyroscopic, implicit_gyroscopic, midpoint, rk4, symmetric_top
from reference_impl.rotations import note as note_rotation
from reference_impl.step import DAMPING_ORDER, TRANSLATION_DISCRETISATION, TRANSLATION_ORDER

Leaf = ModuleType
"""A module with one method, and the facts about it:

- `ORDER`: its order of accuracy in dt, infinite if it is exact, None if it claims none.
- `RUNS_IN_LANES`: whether it can work on many bodies in the lanes of a register.
- `DISCRETISATION`, of a rotation: the name of the discretisation, which engines of the same discretisation share.
- `ANY_FRICTION`, of a law: whether it takes a coefficient of friction between 0 and infinity.
"""
KernelFunction = Callable[..., Any]
"""A function of kernel values that can stand at one place of `step.advance`."""

ROTATIONS: Mapping[str, Leaf] = {
    "note": note_rotation,
    "gyroscopic": gyroscopic,
    "implicit-gyroscopic": implicit_gyroscopic,
    "midpoint": midpoint,
    "rk4": rk4,
    "symmetric-top": symmetric_top,
    "exact": exact,
}
LAWS: Mapping[str, Leaf] = {"note": note, "normal": normal, "poisson": poisson, "clamped": clamped, "coulomb": coulomb}
CONTACTS: Mapping[str, Leaf] = {"mean": mean, "sequential": sequential}
CORRECTIONS: Mapping[str, Leaf | None] = {"none": None, "projection": projection}
COLLIDE: Mapping[str, Mapping[str, KernelFunction]] = {
    "mean": dict.fromkeys(LAWS, mean.collide),
    "sequential": {"normal": sequential.collide_normal, "coulomb": sequential.collide_coulomb},
}
"""The contact treatment's function for each law that it works with."""


@dataclass(frozen=True)
class Methods:
    """One leaf for each place; the defaults are those of the lecture note.

    Raises:
        ValueError: There is no such leaf, or the contact does not work with the law.
    """

    rotation: str = "note"
    law: str = "note"
    contact: str = "mean"
    correction: str = "none"

    def __post_init__(self) -> None:
        for place, chosen, known in (
            ("rotation", self.rotation, list(ROTATIONS)),
            ("law", self.law, list(LAWS)),
            ("contact", self.contact, list(CONTACTS)),
            ("correction", self.correction, list(CORRECTIONS)),
        ):
            if chosen not in known:
                raise ValueError(f"{place}: got {chosen!r}; must be one of {', '.join(known)}")
        if self.law not in COLLIDE[self.contact]:
            laws = ", ".join(COLLIDE[self.contact])
            raise ValueError(f"contact {self.contact!r} works with the laws {laws}, not with {self.law!r}")

    @property
    def runs_in_lanes(self) -> bool:
        """Whether bodies can be worked on in the lanes of a register."""
        return all(leaf.RUNS_IN_LANES for leaf in (ROTATIONS[self.rotation], *self._floor_leaves))

    @property
    def takes_any_friction(self) -> bool:
        """Whether the law takes a coefficient of friction between 0 and infinity."""
        return bool(LAWS[self.law].ANY_FRICTION)

    def order(self, *, gravity: bool, damping: bool, floor: bool) -> float | None:
        """Order of accuracy in dt of a motion: the lowest of the parts that it needs; None if one of them claims none."""
        orders: list[float | None] = [ROTATIONS[self.rotation].ORDER]
        orders += [TRANSLATION_ORDER] if gravity else []
        orders += [DAMPING_ORDER] if damping else []
        orders += [leaf.ORDER for leaf in self._floor_leaves] if floor else []
        claimed = [order for order in orders if order is not None]
        return min(claimed) if len(claimed) == len(orders) else None

    def discretisation(self, *, tumbles: bool) -> str:
        """Name of the discretisation of a flight: the rotation's, or where its choice does not matter the translation's."""
        return str(ROTATIONS[self.rotation].DISCRETISATION if tumbles else TRANSLATION_DISCRETISATION)

    @property
    def _floor_leaves(self) -> list[Leaf]:
        """The leaves that act on a floor only."""
        correction = CORRECTIONS[self.correction]
        return [LAWS[self.law], CONTACTS[self.contact], *([correction] if correction else [])]
