"""Solutions of polynomial differential equations by Taylor series, to 40 digits: no elliptic function, no library solver.

Each Taylor coefficient of a solution follows from the lower ones by sums of products. Numbers are integers of a fixed point, which Python
multiplies exactly and much faster than mpmath its floats; a step is as long as the series has converged to 44 digits.
"""

from operator import mul

from mpmath import mp, mpf

ORDER = 50
DIGITS = 40
BITS = 200  # after the binary point: 60 decimal digits, 20 of them against the rounding of many steps


class Expression:
    """A polynomial of the unknowns; arithmetic with other expressions and with numbers."""

    def __add__(self, other):
        return Sum(self, other, 1)

    def __sub__(self, other):
        return Sum(self, other, -1)

    def __mul__(self, other):
        return Product(self, other) if isinstance(other, Expression) else Multiple(self, _fixed(other))

    __rmul__ = __mul__


class Unknown(Expression):
    def extend(self, n):
        """Unknowns are extended by the integration itself."""


class Sum(Expression):
    def __init__(self, a, b, sign):
        self.a, self.b, self.sign, self.series = a, b, sign, []

    def extend(self, n):
        self.series.append(self.a.series[n] + self.sign * self.b.series[n])


class Multiple(Expression):
    def __init__(self, a, factor):
        self.a, self.factor, self.series = a, factor, []

    def extend(self, n):
        self.series.append((self.factor * self.a.series[n]) >> BITS)


class Product(Expression):
    def __init__(self, a, b):
        self.a, self.b, self.series = a, b, []

    def extend(self, n):
        self.series.append(sum(map(mul, self.a.series, self.b.series[n::-1])) >> BITS)


class Solution:
    """The solution of y' = rates(y), a list of expressions of the list of unknowns; call it with ascending times.

    Everything starts from the exact values of the numbers given. `step` is the longest step; `order` the number of terms.
    """

    def __init__(self, rates, start, step, order=ORDER):
        with mp.workdps(DIGITS + 20):
            self._unknowns = [Unknown() for _ in start]
            self._rates = rates(self._unknowns)
            self._nodes = _in_order(self._rates)
            self._values = [_fixed(value) for value in start]
            self._time, self._step, self._order = mpf(0), _fixed(step), order
            self._expand()

    def __call__(self, time):
        """The unknowns at a time, as mpmath numbers of 40 digits."""
        with mp.workdps(DIGITS + 20):
            while mpf(time) > self._time + mpf(self._valid) / 2**BITS:
                self._values = self._at(self._valid)
                self._time += mpf(self._valid) / 2**BITS
                self._expand()
            found = [mpf(value) / 2**BITS for value in self._at(_fixed(mpf(time) - self._time))]
        with mp.workdps(DIGITS):
            return [+value for value in found]

    def _expand(self):
        """The Taylor coefficients at the current time, in units of the step, and how far the series is good to 40 digits."""
        for node in (*self._nodes, *self._unknowns):
            node.series = []
        for unknown, value in zip(self._unknowns, self._values, strict=True):
            unknown.series.append(value)
        for n in range(self._order):
            for node in self._nodes:
                node.extend(n)
            for unknown, rate in zip(self._unknowns, self._rates, strict=True):
                unknown.series.append(((self._step * rate.series[n]) >> BITS) // (n + 1))
        last = max(abs(unknown.series[n]) for unknown in self._unknowns for n in (self._order - 1, self._order))
        excess = max(last.bit_length() - NEGLIGIBLE.bit_length(), 0)
        self._valid = (self._step * int(2.0 ** (53 - excess / (self._order - 1)))) >> 53

    def _at(self, time):
        """The unknowns at a fixed-point time since the expansion."""
        share = (time << BITS) // self._step
        values = []
        for unknown in self._unknowns:
            value = 0
            for coefficient in reversed(unknown.series):
                value = ((value * share) >> BITS) + coefficient
            values.append(value)
        return values


def _fixed(value):
    return int(mpf(value) * 2**BITS)


NEGLIGIBLE = _fixed(mpf(10) ** -(DIGITS + 4))


def _in_order(expressions):
    """The operations that expressions consist of, operands before what is made of them."""
    found = []

    def visit(node):
        if node in found or isinstance(node, Unknown):
            return
        for operand in (node.a, *([node.b] if hasattr(node, "b") else [])):
            visit(operand)
        found.append(node)

    for expression in expressions:
        visit(expression)
    return found


def free_rotor(moments, spin, quaternion, times, order=ORDER, step="0.8", damping=0.0):
    """Quaternions [x, y, z, w] (body to world) and body-frame spins of a free rigid body at ascending times, from t = 0.

    `step` is divided by the spin. `damping` is the decay rate κ of (I ω)' = -κ I ω.
    """
    with mp.workdps(DIGITS + 20):
        I1, I2, I3 = map(mpf, moments)
        factors = ((I2 - I3) / I1, (I3 - I1) / I2, (I1 - I2) / I3)
        norm = mp.sqrt(sum(mpf(c) ** 2 for c in quaternion))
        start = [*map(mpf, spin), *(mpf(c) / norm for c in quaternion)]
        longest = mpf(step) / mp.sqrt(sum(mpf(w) ** 2 for w in spin))

    def rates(unknowns):
        w1, w2, w3, x, y, z, s = unknowns
        products = (w2 * w3, w3 * w1, w1 * w2)
        return [
            *(factor * product - damping * w for factor, product, w in zip(factors, products, (w1, w2, w3), strict=True)),
            0.5 * (s * w1 + y * w3 - z * w2),
            0.5 * (s * w2 + z * w1 - x * w3),
            0.5 * (s * w3 + x * w2 - y * w1),
            -0.5 * (x * w1 + y * w2 + z * w3),
        ]

    solution = Solution(rates, start, longest, order)
    found = [solution(time) for time in times]
    return [(state[3:], state[:3]) for state in found]
