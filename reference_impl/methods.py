"""The note's method and the ones beside it, by name: which leaf stands at which place of Algorithm 1."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from reference_impl.contacts import mean, sequential
from reference_impl.laws import clamped, coulomb, normal, note, poisson
from reference_impl.projection import lift
from reference_impl.rotations import exact, gyroscopic, implicit_gyroscopic, midpoint, rk4, symmetric_top
from reference_impl.rotations import note as note_rotation

Leaf = Callable[..., Any]
"""A function of kernel values that can stand at one place of `step.advance`."""

ROTATIONS: dict[str, Leaf] = {
    "note": note_rotation.turn,
    "gyroscopic": gyroscopic.turn,
    "implicit-gyroscopic": implicit_gyroscopic.turn,
    "midpoint": midpoint.turn,
    "rk4": rk4.turn,
    "symmetric-top": symmetric_top.turn,
    "exact": exact.turn,
}
LAWS: dict[str, Leaf] = {
    "note": note.impulse,
    "normal": normal.impulse,
    "poisson": poisson.impulse,
    "clamped": clamped.impulse,
    "coulomb": coulomb.impulse,
}
CONTACTS: dict[str, dict[str, Leaf]] = {
    "mean": dict.fromkeys(LAWS, mean.collide),
    "sequential": {"normal": sequential.collide_normal, "coulomb": sequential.collide_coulomb},
}
CORRECTIONS: dict[str, Leaf | None] = {"none": None, "projection": lift}
ONE_BY_ONE = {"exact", "sequential"}
"""Methods whose every decision differs from body to body: an ensemble of them runs one body after the other."""


@dataclass(frozen=True)
class Methods:
    """One leaf for each place; the defaults are the note, literally.

    Raises:
        ValueError: There is no such leaf, or the contact does not go with the law.
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
        if self.law not in CONTACTS[self.contact]:
            laws = ", ".join(CONTACTS[self.contact])
            raise ValueError(f"contact {self.contact!r} works with the laws {laws}, not with {self.law!r}")

    @property
    def go_side_by_side(self) -> bool:
        """Whether bodies can be worked on in the lanes of a register."""
        return not ONE_BY_ONE & {self.rotation, self.contact}
