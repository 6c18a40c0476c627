"""Normal form of the mission for the planner: visits, homes, invariants, and the rest.

Visits and homes become knots, invariants become rows on control points, both exact in continuous
time; any other nest of operators is `rest`, whose witnesses and branches are chosen step by step
(witness.py). Formulas are the dicts of `Formula` in crates/core.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from fleet.stl.normal import normal_form
from fleet.stl.vocabulary import Clause, Formula


@dataclass(frozen=True)
class Visit:
    """Some drone of `options` (drone, region) is in its region at one time of `window`, for `dwell` [s]."""

    clause: str
    options: tuple[tuple[str, str], ...]
    window: tuple[float, float]
    dwell: float = 0.0


@dataclass(frozen=True)
class Home:
    """`drone` ends the mission in `region`: the witness is the horizon itself."""

    clause: str
    drone: str
    region: str


@dataclass(frozen=True)
class Invariant:
    """Over all of `window`: inside or outside `region`, at least `value` apart, or a linear bound.

    `kind` is inside, outside, apart or linear; `row` (three factors and a constant) is for linear.
    """

    clause: str
    kind: str
    drones: tuple[str, ...]
    window: tuple[float, float]
    region: str = ""
    value: float = 0.0
    row: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Rest:
    """A part of a clause that has no normal form."""

    clause: str
    formula: Formula


@dataclass
class Specification:
    """The mission in normal form; `kinds` tells of every clause whether it is invariant, event or rest."""

    visits: list[Visit] = field(default_factory=list)
    homes: list[Home] = field(default_factory=list)
    invariants: list[Invariant] = field(default_factory=list)
    rest: list[Rest] = field(default_factory=list)
    kinds: dict[str, str] = field(default_factory=dict)

    def changing(self, horizon: float) -> bool:
        """Whether what must be kept depends on the time: visits are better early, or late, then."""
        whole = all(i.window[0] <= 0 and i.window[1] >= horizon - 1e-9 for i in self.invariants)
        return bool(self.rest) or not whole


DUAL = {"always": "eventually", "eventually": "always", "once": "historically", "historically": "once"}
"""What the negation of a temporal operator is, over the negation of its operand."""


def negation_normal(f: Formula, positive: bool = True) -> Formula:
    """The formula with `not` and `implies` pushed into predicates; `not` stays before `until` and `since`."""
    op = f["op"]
    if op == "not":
        return negation_normal(f["f"], not positive)
    if op == "implies":
        parts = [{"op": "not", "f": f["left"]}, f["right"]]
        return negation_normal({"op": "or", "fs": parts}, positive)
    if op in ("and", "or"):
        dual = {"and": "or", "or": "and"}
        return {"op": op if positive else dual[op], "fs": [negation_normal(g, positive) for g in f["fs"]]}
    if op in DUAL:
        inner = negation_normal(f["f"], positive)
        return {"op": op if positive else DUAL[op], "from": f["from"], "to": f["to"], "f": inner}
    if positive:
        if op in ("until", "since"):
            return {**f, "left": negation_normal(f["left"]), "right": negation_normal(f["right"])}
        return dict(f)
    if op in ("in", "outside"):
        return {**f, "op": "outside" if op == "in" else "in"}
    if op == "dist":
        return {**f, "cmp": "le" if f["cmp"] == "ge" else "ge"}
    if op == "linear":
        return {
            "op": op,
            "terms": [{**t, "coef": -t["coef"]} for t in f["terms"]],
            "constant": -f["constant"],
        }
    return {"op": "not", "f": negation_normal(f)}


def specification(clauses: Sequence[Clause], horizon: float) -> Specification:
    """Normal form of the clauses of a mission of `horizon` [s].

    It starts from `fleet.stl.normal` and then takes up what can still be posed exactly: predicates
    over a part of the mission.
    """
    form = normal_form([Clause(c.id, c.text, negation_normal(c.formula)) for c in clauses], horizon)
    spec = Specification()
    for event in form.events:
        options = tuple((v.drone, v.region) for v in event.choices)
        drone, region = options[0]
        at_end = event.dwell == 0 and event.window[1] >= horizon - 1e-9
        if len(options) == 1 and region == f"home.{drone}" and at_end:
            spec.homes.append(Home(event.clause, drone, region))
            continue
        spec.visits.append(Visit(event.clause, options, event.window, event.dwell))
    for gather in form.gathers:
        at_home = all(v.region == f"home.{v.drone}" for v in gather.visits)
        if at_home and gather.window[1] >= horizon - 1e-9:
            spec.homes += [Home(gather.clause, v.drone, v.region) for v in gather.visits]
        else:
            fs = [{"op": "in", "drone": v.drone, "region": v.region} for v in gather.visits]
            window = {"from": gather.window[0], "to": gather.window[1]}
            whole: Formula = {"op": "eventually", **window, "f": {"op": "and", "fs": fs}}
            spec.rest.append(Rest(gather.clause, whole))
    for inv in form.invariants:
        predicate(spec, inv.clause, inv.predicate, (0.0, horizon))
    for rest in form.rest:
        refine(spec, rest.clause, rest.formula)
    for clause in clauses:
        kinds = [k for k, parts in parts_by_kind(spec) if any(p.clause == clause.id for p in parts)]
        spec.kinds[clause.id] = kinds[0] if kinds else "invariant"
    return spec


def parts_by_kind(spec: Specification) -> list[tuple[str, Sequence[Visit | Home | Invariant | Rest]]]:
    """The parts under the kind that they give their clause, the most telling kind first."""
    return [("rest", spec.rest), ("event", [*spec.visits, *spec.homes]), ("invariant", spec.invariants)]


def predicate(spec: Specification, clause: str, f: Formula, window: tuple[float, float]) -> None:
    """Add a predicate that holds over all of `window` [s]."""
    op = f["op"]
    if op in ("in", "outside"):
        kind = "inside" if op == "in" else "outside"
        spec.invariants.append(Invariant(clause, kind, (f["drone"],), window, f["region"]))
    elif op == "dist" and f["cmp"] == "ge":
        spec.invariants.append(Invariant(clause, "apart", (f["a"], f["b"]), window, value=f["value"]))
    elif op == "linear" and len({t["drone"] for t in f["terms"]}) == 1:
        row = [sum(t["coef"] for t in f["terms"] if t["axis"] == axis) for axis in "xyz"]
        coefficients = (row[0], row[1], row[2], float(f["constant"]))
        drones = (f["terms"][0]["drone"],)
        spec.invariants.append(Invariant(clause, "linear", drones, window, row=coefficients))
    else:
        spec.rest.append(Rest(clause, {"op": "always", "from": window[0], "to": window[1], "f": f}))


def refine(spec: Specification, clause: str, f: Formula) -> None:
    """Add a part that has no shape of `fleet.stl.normal`: a windowed invariant, or rest."""
    if f["op"] == "always":
        window, g = (f["from"], f["to"]), f["f"]
        if g["op"] == "always":
            refine(spec, clause, {**g, "from": window[0] + g["from"], "to": window[1] + g["to"]})
        elif g["op"] == "and":
            for part in g["fs"]:
                refine(spec, clause, {**f, "f": part})
        elif g["op"] in ("in", "outside", "dist", "linear") and window[1] > window[0]:
            predicate(spec, clause, g, window)
        else:
            spec.rest.append(Rest(clause, f))
        return
    spec.rest.append(Rest(clause, f))
