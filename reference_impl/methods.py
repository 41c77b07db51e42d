"""The methods by name: the module that implements each step of Algorithm 1, and the properties that the module declares."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from dropspin.reference_impl.contacts import mean, sequential
from dropspin.reference_impl.laws import clamped, coulomb, normal, note, poisson
from dropspin.reference_impl.rotations import exact, gyroscopic, implicit_gyroscopic, midpoint, rk4
from dropspin.reference_impl.rotations import note as note_rotation
from dropspin.reference_impl.step import DAMPING_ORDER, TRANSLATION_DISCRETISATION, TRANSLATION_ORDER

Leaf = ModuleType
"""A module with one method and its properties:

- `ORDER`: its order of accuracy in dt, infinite if it is exact, None if it claims none.
- `DISCRETISATION`, of a rotation: the name of the discretisation, which engines of the same discretisation share.
- `ANY_FRICTION`, of a law: whether it takes a coefficient of friction between 0 and infinity.
"""
KernelFunction = Callable[..., Any]
"""A function of kernel values that can be called at one place of `step.advance`."""

ROTATIONS: Mapping[str, Leaf] = {
    "note": note_rotation,
    "gyroscopic": gyroscopic,
    "implicit-gyroscopic": implicit_gyroscopic,
    "midpoint": midpoint,
    "rk4": rk4,
    "exact": exact,
}
LAWS: Mapping[str, Leaf] = {"note": note, "normal": normal, "poisson": poisson, "clamped": clamped, "coulomb": coulomb}
CONTACTS: Mapping[str, Leaf] = {"mean": mean, "sequential": sequential}
COLLIDE: Mapping[str, Mapping[str, KernelFunction]] = {
    "mean": dict.fromkeys(LAWS, mean.collide),
    "sequential": {"normal": sequential.collide_normal, "coulomb": sequential.collide_coulomb},
}
"""The contact treatment's function for each law that it works with."""


@dataclass(frozen=True)
class Methods:
    """The method for each part of the algorithm: rotation, impact law, and contact treatment. The defaults are those of the lecture note.

    Raises:
        ValueError: A method does not exist, or the contact treatment does not work with the law.
    """

    rotation: str = "note"
    law: str = "note"
    contact: str = "mean"

    def __post_init__(self) -> None:
        for place, known in (("rotation", list(ROTATIONS)), ("law", list(LAWS)), ("contact", list(CONTACTS))):
            if (chosen := getattr(self, place)) not in known:
                raise ValueError(f"{place}: got {chosen!r}; must be one of {', '.join(known)}")
        if self.law not in COLLIDE[self.contact]:
            laws = ", ".join(COLLIDE[self.contact])
            raise ValueError(f"contact {self.contact!r} works with the laws {laws}, not with {self.law!r}")

    @property
    def takes_any_friction(self) -> bool:
        """Whether the law takes a coefficient of friction between 0 and infinity."""
        return bool(LAWS[self.law].ANY_FRICTION)

    def order(self, *, gravity: bool, damping: bool, floor: bool) -> float | None:
        """Order of accuracy in dt of a motion: the lowest of the parts that are used; None if one of them claims none."""
        orders: list[float | None] = [ROTATIONS[self.rotation].ORDER]
        orders += [TRANSLATION_ORDER] if gravity else []
        orders += [DAMPING_ORDER] if damping else []
        orders += [LAWS[self.law].ORDER, CONTACTS[self.contact].ORDER] if floor else []
        claimed = [order for order in orders if order is not None]
        return min(claimed) if len(claimed) == len(orders) else None

    def discretisation(self, *, tumbles: bool) -> str:
        """Name of the discretisation of a flight: that of the rotation, or that of the translation if the rotation has no effect."""
        return str(ROTATIONS[self.rotation].DISCRETISATION if tumbles else TRANSLATION_DISCRETISATION)
