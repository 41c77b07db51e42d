"""Rest on MuJoCo's soft contacts: the depth at which a contact carries its load.

A constraint with the impedance d, the stiffness K and the regularisation R = (1 - d)/d A has, at rest, the force f = K d r/R, with the
depth r; A is the inverse mass of the constraint. With solref = (t_c, ζ), or (-k, -b), and d_m, the second number of solimp:

    K = 1/(d_m t_c ζ)² or k/d_m²,   d = d(r) by solimp

A contact of the load a = A F, where F is its normal force, rests at the depth

    r = k (1 - d) a / (K d²),   k = 1 (elliptic cone, condim 1),   k = µ² (1 + µ²)/((condim - 1) impratio) (pyramidal cone)

because the 2 (condim - 1) edges of a pyramid have R = 2 µ² (1 + µ²)/impratio (1 - d)/d A. For µ = 1 and impratio 1, k is 2/(condim - 1).

Source: MuJoCo documentation, chapters Computation (constraint model) and Modeling (solver parameters, contact parameters); the
pyramid's R is that of `efc_R` (tests compare all of this with MuJoCo).
Valid for: MuJoCo 4, contacts without adhesion and surface velocity.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

SMALLEST, LARGEST = 1e-4, 0.9999
"""Range of impedances and of the midpoint of solimp: mjMINIMP and mjMAXIMP."""
NO_WIDTH = 1e-15
"""Width of solimp up to which the impedance is constant, and smallest solmix that counts: mjMINVAL."""
LEAST_FRICTION = 1e-5
"""mjMINMU."""
SCANNED = 1000
"""Intervals of the width in which a root is looked for if the impedance falls with depth: a body that sinks stops at the first one."""


@dataclass(frozen=True)
class GeomSettings:
    """The settings of contacts that a geometry has, with MuJoCo's defaults.

    Attributes:
        solref: Time constant [s] and damping ratio, both positive; or stiffness [1/s²] and damping [1/s], both not positive.
        solimp: Smallest and largest impedance, width [m], midpoint, power.
        friction: Sliding, torsional [m], rolling [m].
        condim: 1, 3, 4 or 6.
        margin: Distance at which contacts begin [m].
        priority: Of two geometries, the one with the larger number gives solref, solimp, friction and condim.
        solmix: Weight in the mean of solref and of solimp of two geometries of the same priority.
    """

    solref: tuple[float, ...] = (0.02, 1.0)
    solimp: tuple[float, ...] = (0.9, 0.95, 0.001, 0.5, 2.0)
    friction: tuple[float, ...] = (1.0, 0.005, 0.0001)
    condim: int = 3
    margin: float = 0.0
    priority: int = 0
    solmix: float = 1.0


def mixed(first: GeomSettings, second: GeomSettings) -> GeomSettings:
    """The settings of a contact of two geometries: those of the larger priority; else the larger friction and condim, and means by solmix.

    A solref with a number that is not positive is not averaged: of two numbers, the smaller one counts. Margins are added.
    """
    margin = first.margin + second.margin
    if first.priority != second.priority:
        return replace(max(first, second, key=lambda geom: geom.priority), margin=margin)
    weights = [geom.solmix if geom.solmix >= NO_WIDTH else 0.0 for geom in (first, second)]
    share = weights[0] / sum(weights) if any(weights) else 0.5
    pairs = list(zip(first.solref, second.solref, strict=True))
    averaged = first.solref[0] > 0.0 and second.solref[0] > 0.0
    return GeomSettings(
        solref=tuple(share * a + (1.0 - share) * b if averaged else min(a, b) for a, b in pairs),
        solimp=tuple(share * a + (1.0 - share) * b for a, b in zip(first.solimp, second.solimp, strict=True)),
        friction=tuple(max(a, b) for a, b in zip(first.friction, second.friction, strict=True)),
        condim=max(first.condim, second.condim),
        margin=margin,
        priority=first.priority,
    )


@dataclass(frozen=True)
class SoftContact:
    """A contact with its settings in force.

    Loads are forces of one contact times A, its inverse mass [1/kg]: the sum of `body_invweight0[body, 0]` of both bodies, which is
    1/(m + armature) for a free body whose centre of mass is the joint's origin, and 0 for a fixed one. With the flag `diagexact` and
    elliptic cones, A is that of the normal at the contact point, which includes rotation.

    Attributes:
        settings: Those of the pair of geometries, such as `mixed` gives them.
        elliptic: Whether friction cones are elliptic; else pyramidal.
        impratio: Ratio of frictional to normal impedance.
        time_step: The time step [s], which limits time constants to 2 dt and more; 0 with the flag `refsafe` disabled.
    """

    settings: GeomSettings
    elliptic: bool = False
    impratio: float = 1.0
    time_step: float = 0.0

    def impedance(self, depth: float) -> float:
        """d(r) of a depth [m]: from the smallest to the largest impedance over the width, by two powers that meet at the midpoint."""
        smallest, largest, width, middle, power = self.settings.solimp
        smallest, largest, middle, power = _in_range(smallest), _in_range(largest), _in_range(middle), max(power, 1.0)
        if smallest == largest or width <= NO_WIDTH:
            return 0.5 * (smallest + largest)
        x = min(abs(depth) / width, 1.0)
        rise = x**power / middle ** (power - 1.0) if x <= middle else 1.0 - (1.0 - x) ** power / (1.0 - middle) ** (power - 1.0)
        return smallest + rise * (largest - smallest)

    @property
    def stiffness(self) -> float:
        """K [1/s²]. A solref of mixed signs is replaced with the default."""
        first, second = self.settings.solref
        if (first > 0.0) != (second > 0.0):
            first, second = GeomSettings.solref
        largest = _in_range(self.settings.solimp[1])
        if first <= 0.0:
            return -first / largest**2
        first = max(first, 2.0 * self.time_step)
        return 1.0 / (largest * first * second) ** 2

    def depth(self, load: float) -> float:
        """The depth at rest below the margin [m], infinite without stiffness; the gap is `settings.margin` less the depth.

        Args:
            load: A F [m/s²], g of a ball on the floor and g/n of each of n contacts that share a weight.
        """
        stiffness = self.stiffness
        if not stiffness:
            return math.inf if load else 0.0
        return self._root(lambda r: stiffness * r * self.impedance(r) / self._softness(r) - load)

    def _softness(self, depth: float) -> float:
        """R/A of the normal force: k (1 - d)/d."""
        d, mu2 = self.impedance(depth), max(self.settings.friction[0], LEAST_FRICTION) ** 2
        pyramid = not self.elliptic and self.settings.condim > 1
        k = mu2 * (1.0 + mu2) / ((self.settings.condim - 1) * self.impratio) if pyramid else 1.0
        return k * (1.0 - d) / d

    def _root(self, excess: Callable[[float], float]) -> float:
        """The smallest depth [m] at which a function that is negative at 0 is 0."""
        from scipy.optimize import brentq

        smallest, largest, width = self.settings.solimp[:3]
        step = max(width, NO_WIDTH) / (SCANNED if smallest > largest else 1)
        low, high = 0.0, step
        while excess(high) < 0.0:
            low, high = high, high + step if high < width else 2.0 * high
        return float(brentq(excess, low, high, xtol=1e-300, rtol=1e-14))


def _in_range(impedance: float) -> float:
    return min(max(impedance, SMALLEST), LARGEST)
