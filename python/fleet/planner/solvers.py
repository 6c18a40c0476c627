"""IPOPT solvers by the shape of their program: built once a process, called again with other numbers."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from .knots import Array
from .listening import Listener
from .stages import Given, Posed
from .terms import Term

#: Solvers that are kept; one plan takes a few, of some megabytes each.
KEPT = 32


@dataclass(frozen=True)
class Shape:
    """What a solver is built for: knots' unknowns, the terms' expressions and sizes, and IPOPT's settings.

    `terms` are (pose, shape, own unknowns, parameters) each; `quasi` asks for a quasi-Newton Hessian, since
    smooth robustness over many samples makes a dense and indefinite one.
    """

    size: int
    terms: tuple[tuple[Callable[..., Posed], tuple[Hashable, ...], int, int], ...]
    iterations: int
    tolerance: float
    quasi: bool


@dataclass(frozen=True)
class Solver:
    """A built solver, its listener, constraints of every term, and whether smooth robustness is in it.

    Unknowns are all knots, r, and those of the terms; parameters the weight of smoothness, the sharpness c
    [1/m], and those of the terms.
    """

    function: Any
    listener: Listener
    counts: tuple[int, ...]
    smoothed: bool


def solver_for(size: int, terms: Sequence[Term], iterations: int, tolerance: float, *, quasi: bool) -> Solver:
    """The solver of a program of `size` unknowns of knots: built, or the one built before."""
    posed = tuple((t.pose, t.shape, len(t.guess), len(t.numbers)) for t in terms)
    return built(Shape(size, posed, iterations, tolerance, quasi))


@lru_cache(maxsize=KEPT)
def built(shape: Shape) -> Solver:
    """Build a solver: the expressions of its terms, their derivatives, and IPOPT around them."""
    x, r = ca.MX.sym("x", shape.size), ca.MX.sym("r")
    weight, c = ca.MX.sym("weight"), ca.MX.sym("c")
    own = [ca.MX.sym("own", count) for _, _, count, _ in shape.terms]
    numbers = [ca.MX.sym("numbers", count) for _, _, _, count in shape.terms]
    columns, cost = [], ca.MX(0)
    for (pose, form, _, _), mine, given in zip(shape.terms, own, numbers, strict=True):
        posed = pose(Given(x, r, mine, given, c), *form)
        columns.append(ca.vertcat(*posed.columns))
        cost += 0 if posed.cost is None else posed.cost
    statement = {
        "x": ca.vertcat(x, r, *own),
        "f": -r + weight * cost,
        "g": ca.vertcat(*columns),
        "p": ca.vertcat(weight, c, *numbers),
    }
    listener = Listener("listener", tuple(statement[k].numel() for k in "xgp"))
    options: dict[str, Any] = {
        "ipopt": {
            "linear_solver": "mumps",
            "max_iter": shape.iterations,
            "tol": shape.tolerance,
            "constr_viol_tol": 1e-7,
            "acceptable_iter": 0,
            "mu_strategy": "adaptive",
            "hessian_approximation": "limited-memory" if shape.quasi else "exact",
            "print_level": 0,
            "sb": "yes",
        },
        "print_time": False,
        "iteration_callback": listener,
    }
    function = ca.nlpsol("plan", "ipopt", statement, options)
    smoothed = bool(ca.depends_on(statement["g"], c))
    return Solver(function, listener, tuple(g.numel() for g in columns), smoothed)


def run(
    solver: Solver,
    terms: Sequence[Term],
    guess: Array,
    bound: float,
    weight: float,
    c: float,
    tell: Callable[[], None] | None,
) -> Array | None:
    """All unknowns at the optimum from `guess`, r at most `bound` [m]; None unless IPOPT succeeded."""
    free = len(guess) - sum(len(t.guess) for t in terms) - 1
    low = [np.full(free + 1, -np.inf), *(np.full(len(t.guess), t.own_low) for t in terms)]
    high = [np.full(free, np.inf), np.array([bound]), *(np.full(len(t.guess), t.own_high) for t in terms)]
    with solver.listener.listening(None if tell is None else lambda _unknowns: tell()):
        found = solver.function(
            x0=guess,
            p=np.concatenate([[weight, c], *(t.numbers for t in terms)]),
            lbx=np.concatenate(low),
            ubx=np.concatenate(high),
            lbg=np.concatenate(
                [np.broadcast_to(t.low, n) for t, n in zip(terms, solver.counts, strict=True)]
            ),
            ubg=np.concatenate(
                [np.broadcast_to(t.high, n) for t, n in zip(terms, solver.counts, strict=True)]
            ),
        )
    if solver.function.stats()["return_status"] != "Solve_Succeeded":
        return None
    return np.asarray(found["x"]).ravel()
