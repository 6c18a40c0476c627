"""Linear forms over coordinates and distances, the arithmetic of predicates and windows."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from fleet.stl.vocabulary import Formula


@dataclass(frozen=True)
class LinearForm:
    """`constant + sum of factor * drone.axis + sum of factor * dist(a, b)`."""

    constant: float
    coordinates: dict[tuple[str, str], float] = field(default_factory=dict)
    distances: dict[tuple[str, str], float] = field(default_factory=dict)

    @property
    def is_constant(self) -> bool:
        """Whether it is a number alone."""
        return not self.coordinates and not self.distances

    @property
    def is_finite(self) -> bool:
        """Whether no number in it has overflowed."""
        return all(map(math.isfinite, (self.constant, *self.coordinates.values(), *self.distances.values())))

    def __add__(self, other: LinearForm) -> LinearForm:
        """The sum; what cancels is left out."""
        return LinearForm(
            self.constant + other.constant,
            _sum(self.coordinates, other.coordinates),
            _sum(self.distances, other.distances),
        )

    def __sub__(self, other: LinearForm) -> LinearForm:
        """The difference; what cancels is left out."""
        return self + other.scaled(-1.0)

    def scaled(self, factor: float, divisor: float = 1.0) -> LinearForm:
        """`self * factor / divisor`; the divisor apart, so that T/3 is rounded once."""
        return LinearForm(
            self.constant * factor / divisor,
            {key: value * factor / divisor for key, value in self.coordinates.items() if factor},
            {key: value * factor / divisor for key, value in self.distances.items() if factor},
        )

    def predicate(self) -> Formula:
        """The formula `self >= 0`; only without distances."""
        terms = [{"drone": d, "axis": axis, "coef": coef} for (d, axis), coef in self.coordinates.items()]
        return {"op": "linear", "terms": terms, "constant": self.constant + 0.0}


def _sum(
    left: dict[tuple[str, str], float], right: dict[tuple[str, str], float]
) -> dict[tuple[str, str], float]:
    total = dict(left)
    for key, value in right.items():
        total[key] = total.get(key, 0.0) + value
    return {key: value for key, value in total.items() if value != 0}
