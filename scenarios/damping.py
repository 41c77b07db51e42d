"""The damping of a scene: a table of its file."""

import math
from typing import Annotated, Self

from pydantic import Field, model_validator

from dropspin.scenarios.field_types import NotNegative, Number, Positive, Table

MOTIONS = ("linear", "angular")
Share = Annotated[Number, Field(gt=0, le=1)]


class Damping(Table):
    """Exponential decay of velocity and angular velocity.

    `linear` and `angular` are rates [1/s]. `linear_factor` and `angular_factor` are given in their place: what one step of `factor_dt` [s]
    leaves of a velocity, as Algorithm 1 of Wang's lecture note has it. The rates are then -ln(factor) / factor_dt.
    """

    linear: NotNegative = 0.0
    angular: NotNegative = 0.0
    linear_factor: Share | None = Field(default=None, exclude=True)
    angular_factor: Share | None = Field(default=None, exclude=True)
    factor_dt: Positive | None = None

    @model_validator(mode="after")
    def _factors_give_rates(self) -> Self:
        factors = {name: factor for name in MOTIONS if (factor := getattr(self, f"{name}_factor")) is not None}
        step = self.factor_dt
        if factors and step is None:
            raise ValueError("a factor needs factor_dt, the time step that it is meant at, in s")
        if factors and self.model_fields_set & {*MOTIONS}:
            raise ValueError("has rates (linear, angular) and factors (linear_factor, angular_factor); give one kind")
        for name, factor in factors.items():
            assert step is not None
            object.__setattr__(self, name, -math.log(factor) / step)
            object.__setattr__(self, f"{name}_factor", None)
        return self

    @property
    def rates(self) -> dict[str, float]:
        """`linear` and `angular` [1/s]."""
        return {name: getattr(self, name) for name in MOTIONS}

    @property
    def factors(self) -> dict[str, float]:
        """`linear_factor` and `angular_factor` for one step of `factor_dt`; empty without it."""
        return {f"{name}_factor": math.exp(-rate * self.factor_dt) for name, rate in self.rates.items()} if self.factor_dt else {}
