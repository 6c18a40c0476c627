"""The tables of a scenario file, key by key, with types, ranges and defaults (design.md, Scenario TOML)."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from fleet.scenario.region import Region, from_box, from_prism, from_regular_prism

# A TOML array is a list; strict mode would refuse it for a tuple. The numbers inside stay strict.
# The bound keeps squares and sums from overflowing; no mission is a million metres wide.
Number = Annotated[float, Field(ge=-1e6, le=1e6)]
Vec3 = Annotated[tuple[Number, Number, Number], Field(strict=False)]
Vec2 = Annotated[tuple[Number, Number], Field(strict=False)]
Interval = Annotated[tuple[Number, Number], Field(strict=False)]
Corners = Annotated[tuple[Vec3, Vec3], Field(strict=False)]
Positive = Annotated[float, Field(gt=0, le=1e6)]
Heading = Annotated[float, Field(ge=-2 * math.pi, le=2 * math.pi)]


class Table(BaseModel):
    """A TOML table: unknown keys, text for numbers, nan and inf are refused."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class Mission(Table):
    """`[mission]`: duration T and sample period T_s [s], smoothing c (paper, Def. 2), formula text."""

    T: float = Field(gt=0, le=2560)
    T_s: float = Field(0.05, ge=0.01, le=1)
    c: float = Field(5.0, gt=0, le=1000)
    formula: str | None = None
    seed: int = Field(1, ge=0, lt=2**63)
    fleet: str = "fleet"


class Limits(Table):
    """`[limits]`: per-axis speed [m/s] and acceleration [m/s^2], distances [m], heading rate [rad/s]."""

    v_max: Positive = 3.0
    a_max: Positive = 3.0
    delta_min: Positive = 3.0
    tube: Positive = 0.4
    heading_rate: Positive = math.radians(30)


class Replan(Table):
    """`[replan]`: check period T_e and topic period T_g [s], trigger eta [m] (paper, section IV-C)."""

    T_e: Positive = 0.1
    T_g: Positive = 5.0
    eta: Positive = 0.4
    enabled: bool = True


class Planner(Table):
    """`[planner]`: longest polynomial segment [s]; iterations and tolerance of the solver (paper, sec. V).

    `assignment` says who visits what: "auto", "exact" (proved best, however large the fleet) or "paper"
    (target k to drone k modulo the fleet). Orders of `[assignment]` go before it.
    """

    segment: float = Field(1.0, ge=0.05, le=10)
    max_iterations: int = Field(2000, ge=1, le=100_000)
    tolerance: float = Field(1e-4, gt=0, le=0.1)
    assignment: Literal["auto", "exact", "paper"] = "auto"


class Energy(Table):
    """`[energy]`: robustness is spent on flying with less energy (paper, section III-E).

    `lexicographic`: maximise rho, then make the integral of |a|^2 small at rho >= `floor` [m], or where none
    is given at `give_up` [m] less than the largest. `weighted`: maximise rho - eps' Q eps, with eps above the
    squared acceleration of every sample and axis and Q = `weight` [s^8/m^3] times the identity.
    """

    objective: Literal["lexicographic", "weighted"] = "lexicographic"
    floor: Positive | None = None
    give_up: float = Field(0.05, ge=0, le=1e6)
    weight: Positive = 3000.0


class Prism(Table):
    """Upright prism: `base` corners, or `center`, `apothem` and `sides` of a regular one; and `z`."""

    model_config = ConfigDict(
        json_schema_extra={
            "oneOf": [{"required": ["base"]}, {"required": ["center", "apothem", "sides"]}],
        }
    )

    z: Interval
    base: list[Vec2] | None = None
    center: Vec2 | None = None
    apothem: Number | None = None
    sides: int | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> Prism:
        regular = [key for key in ("center", "apothem", "sides") if getattr(self, key) is not None]
        if len(regular) not in ({0} if self.base is not None else {3}):
            raise PydanticCustomError("shape", "needs either base, or all of center, apothem and sides")
        return self


class Polyhedron(Table):
    """All x with A x <= b, rows of any length."""

    A: list[Vec3] = Field(min_length=4, max_length=256)
    b: list[Number] = Field(min_length=4, max_length=256)

    @model_validator(mode="after")
    def _same_length(self) -> Polyhedron:
        if len(self.A) != len(self.b):
            raise PydanticCustomError(
                "shape",
                "A has {rows} rows and b {values} values; need as many",
                {"rows": len(self.A), "values": len(self.b)},
            )
        return self


def _exactly(*shapes: str) -> ConfigDict:
    """JSON Schema of a table that has exactly one of some keys."""
    return ConfigDict(json_schema_extra={"oneOf": [{"required": [key]} for key in shapes]})


class Shape(Table):
    """Exactly one of `box = [[lo], [hi]]`, `prism = {...}`, `polyhedron = {A, b}` [m]."""

    model_config = _exactly("box", "prism", "polyhedron")

    box: Corners | None = None
    prism: Prism | None = None
    polyhedron: Polyhedron | None = None

    @model_validator(mode="after")
    def _exactly_one(self) -> Shape:
        if sum(shape is not None for shape in (self.box, self.prism, self.polyhedron)) != 1:
            raise PydanticCustomError("shape", "needs exactly one of box, prism and polyhedron")
        return self

    @property
    def kind(self) -> str:
        """Which of the three it is; the name of the key."""
        return "box" if self.box is not None else "prism" if self.prism is not None else "polyhedron"

    def region(self, name: str) -> Region:
        """The region of this shape.

        Raises:
            GeometryError: empty, unbounded or degenerate.
        """
        if self.box is not None:
            return from_box(name, *self.box)
        if self.prism is not None:
            prism = self.prism
            if prism.base is not None:
                return from_prism(name, prism.base, *prism.z)
            assert prism.center and prism.apothem is not None and prism.sides is not None  # _one_kind
            return from_regular_prism(
                name, prism.center, prism.apothem, prism.sides, low=prism.z[0], high=prism.z[1]
            )
        assert self.polyhedron is not None  # _exactly_one
        import numpy as np

        return Region(
            name, np.array(self.polyhedron.A, dtype=float), np.array(self.polyhedron.b, dtype=float)
        )


class Obstacle(Shape):
    """`[[obstacle]]`: already inflated by the vehicle."""

    name: str


class TargetTable(Shape):
    """`[[target]]`: heading to look along there [rad], counter-clockwise from east."""

    name: str
    heading: Heading | None = None


class NamedRegion(Shape):
    """`[[region]]`: a place that the formula speaks of, neither an obstacle nor a target."""

    name: str


class DroneTable(Table):
    """`[[drone]]`: its home region, its pad (vehicle centre at rest [m]) and heading on it [rad].

    `start` is where it hovers at mission time 0 [m]; the centre of home unless given.
    """

    id: str
    home: Shape
    pad: Vec3
    heading: Heading = 0.0
    start: Vec3 | None = None


class Disturbance(Table):
    """`[[disturbance]]`: a force [N; world] on a drone from mission time t, for a duration [s]."""

    drone: str
    t: float = Field(ge=0)
    duration: float = Field(gt=0, le=60)
    force: Vec3


class Wind(Table):
    """`[wind]`: steady wind [m/s; world], and Dryden turbulence for a wind of so much at 20 ft [m/s]."""

    velocity: Vec3 = (0.0, 0.0, 0.0)
    turbulence: float = Field(0.0, ge=0, le=50)


class Gust(Table):
    """`[[gust]]`: swells and fades as 1 - cos from mission time t, over all drones; velocity [m/s; world]."""

    t: float = Field(ge=0)
    duration: float = Field(gt=0, le=600)
    velocity: Vec3
