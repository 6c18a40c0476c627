"""Robustness of a formula by rtamt, over predicates that numpy computes: no code of the package.

rtamt's until leaves out the left side at the switch, ours has it in: ours `a until b` is rtamt's
`a until (a and b)`. With a window [0, b] that is what `eventually[0,b] (a and b)` and the unbounded until
say together, also of robustness: both are maxima over thresholds of the same statement.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import rtamt

from .flown import HZ, Array

Formula = Mapping[str, Any]


@dataclass
class Trace:
    """Positions (n, 3) [m] of every drone at k / HZ, and faces (n, 4: normal, offset) of every region."""

    positions: Mapping[str, Array]
    regions: Mapping[str, Array]

    def predicate(self, f: Formula) -> Array:
        """Robustness (n,) [m] of a predicate."""
        if f["op"] in ("in", "outside"):
            faces = self.regions[f["region"]]
            beyond = (self.positions[f["drone"]] @ faces[:, :3].T - faces[:, 3]).max(axis=1)
            return np.asarray(beyond if f["op"] == "outside" else -beyond)
        if f["op"] == "dist":
            gap = np.linalg.norm(self.positions[f["a"]] - self.positions[f["b"]], axis=1) - f["value"]
            return np.asarray(gap if f["cmp"] == "ge" else -gap)
        terms = [t["coef"] * self.positions[t["drone"]][:, "xyz".index(t["axis"])] for t in f["terms"]]
        return np.asarray(sum(terms) + f["constant"])


@dataclass
class Text:
    """A formula as rtamt's text: one sample a unit of time, predicates as variables that hold them."""

    trace: Trace
    variables: dict[str, Array] = field(default_factory=dict)

    def of(self, f: Formula) -> str:
        """The text of a formula; its predicates become variables."""
        match f["op"]:
            case "not":
                return f"(not {self.of(f['f'])})"
            case "and" | "or":
                return "(" + f" {f['op']} ".join(map(self.of, f["fs"])) + ")"
            case "implies":
                return f"({self.of(f['left'])} implies {self.of(f['right'])})"
            case "always" | "eventually":
                return f"({f['op']}{window(f)} {self.of(f['f'])})"
            case "until":
                assert f["from"] == 0, "the generator has no other until"
                left, right = self.of(f["left"]), self.of(f["right"])
                both = f"({left} and {right})"
                return f"((eventually{window(f)} {both}) and ({left} until {both}))"
        name = f"u{len(self.variables)}"
        self.variables[name] = self.trace.predicate(f)
        return f"({name} >= 0)"


def window(f: Formula) -> str:
    """The window of an operator in samples."""
    return f"[{round(f['from'] * HZ)},{round(f['to'] * HZ)}]"


def temporal(f: Formula) -> bool:
    """Whether there is an operator over time in a formula."""
    inner = [f[key] for key in ("f", "left", "right") if key in f] + list(f.get("fs", []))
    return f["op"] in ("always", "eventually", "until") or any(map(temporal, inner))


def robustness(f: Formula, trace: Trace) -> float:
    """Robustness [m] at time 0.

    A single operator over time needs its own window of the trace only, where it is the unbounded one:
    rtamt is quicker there by far.
    """
    translated, begin, end = Text(trace), 0, None
    # rtamt reads no trace of a single sample.
    single = f["op"] in ("always", "eventually") and f["to"] > f["from"] and not temporal(f["f"])
    if single:
        begin, end = round(f["from"] * HZ), round(f["to"] * HZ) + 1
        spec = f"({f['op']} {translated.of(f['f'])})"
    else:
        spec = translated.of(f)
    statement = rtamt.StlDiscreteTimeSpecification()
    for name in translated.variables:
        statement.declare_var(name, "float")
    statement.spec = spec
    statement.parse()
    columns = {name: values[begin:end].tolist() for name, values in translated.variables.items()}
    count = len(next(iter(columns.values())))
    return float(statement.evaluate({"time": list(range(count)), **columns})[0][1])
