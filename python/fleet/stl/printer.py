"""From a formula back to text; `parse` of the result gives the same tree."""

from __future__ import annotations

from typing import Any

from fleet.stl.vocabulary import Clause, Formula

# How tightly each operator binds; an operand that binds less tightly gets parentheses.
_BINDING = {"implies": 1, "or": 2, "and": 3, "until": 4, "since": 4, "not": 5}
_BINDING |= dict.fromkeys(("always", "eventually", "once", "historically"), 5)
_PREDICATE = 6


def clause_text(clause: Clause) -> str:
    """The clause in the text syntax: name, weight and priority where they say something, formula."""
    parts = (f"@{clause.id}", attributes_text(clause.weight, clause.priority), to_text(clause.formula))
    return " ".join(part for part in parts if part)


def attributes_text(weight: float, priority: int) -> str:
    """`{weight 2, priority 3}`, without what is at its default; empty when both are."""
    shown = [f"weight {_number(weight)}"] if weight != 1 else []
    shown += [f"priority {priority}"] if priority != 0 else []
    return f"{{{', '.join(shown)}}}" if shown else ""


def to_text(formula: Formula) -> str:
    """The formula in the text syntax of design.md, quantifiers expanded, windows in seconds."""
    op = formula["op"]
    own = _BINDING.get(op, _PREDICATE)
    if op in {"and", "or"}:
        return f" {op} ".join(_operand(f, own + 1) for f in formula["fs"])
    if op == "implies":
        return f"{_operand(formula['left'], own + 1)} -> {_operand(formula['right'], own)}"
    if op in {"until", "since"}:
        window = _window(formula)
        return f"{_operand(formula['left'], own + 1)} {op}{window} {_operand(formula['right'], own)}"
    if op == "not":
        return f"not {_operand(formula['f'], own)}"
    if "f" in formula:
        return f"{op}{_window(formula)} {_operand(formula['f'], own)}"
    return _predicate(formula)


def _operand(formula: Formula, least: int) -> str:
    text = to_text(formula)
    return text if _BINDING.get(formula["op"], _PREDICATE) >= least else f"({text})"


def _window(formula: Formula) -> str:
    return f"[{_number(formula['from'])}, {_number(formula['to'])}]"


def _predicate(formula: Formula) -> str:
    op = formula["op"]
    if op in {"in", "outside"}:
        region = formula["region"]
        return f"{formula['drone']} {op} {'home' if region == 'home.' + formula['drone'] else region}"
    if op == "dist":
        sign = ">=" if formula["cmp"] == "ge" else "<="
        return f"dist({formula['a']}, {formula['b']}) {sign} {_number(formula['value'])}"
    return _linear(formula["terms"], formula["constant"])


def _linear(terms: list[dict[str, Any]], constant: float) -> str:
    text = ""
    for term in terms:
        coef, name = term["coef"], f"{term['drone']}.{term['axis']}"
        sign = "-" if coef < 0 else "+"
        size = "" if abs(coef) == 1 else f"{_number(abs(coef))}*"
        text += f" {sign} {size}{name}" if text else f"{'-' if coef < 0 else ''}{size}{name}"
    return f"{text} >= {_number(-constant)}"


def _number(value: float) -> str:
    """The shortest text that reads back as the same number; no `.0` on whole ones."""
    if value == int(value) and abs(value) < 1e15:
        return str(int(value))
    return repr(float(value))
