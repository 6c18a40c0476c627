"""From text to clauses: the grammar of `grammar.lark` with errors that say where and what is legal."""

from __future__ import annotations

import math
from functools import cache
from importlib.resources import files

from lark import Lark, Tree
from lark.exceptions import UnexpectedCharacters, UnexpectedToken

from fleet.errors import FormulaError
from fleet.stl.arithmetic import Node, as_token, as_tree
from fleet.stl.build import Builder
from fleet.stl.vocabulary import Clause, Vocabulary, is_name

MAX_DEPTH = 64
"""Nesting that is still read; every reader of a plan recurses over its formulas."""
MIN_WEIGHT, MAX_WEIGHT = 1e-3, 1e3
"""Legal weights; margins that differ by more than a million could not be told from rounding."""
MAX_PRIORITY = 1_000_000


def parse(text: str, vocabulary: Vocabulary) -> list[Clause]:
    """Reads a mission: clauses `@name f`, or `f` alone, separated by `;` or by the next `@`.

    A named clause may have a weight and a priority, `@name {weight 2, priority 3} f` (see `Clause`).
    Clauses without a name are called c1, c2, ... by their place. Clauses that are true whatever the
    drones do (pairs of a single drone, no obstacles) are left out.

    Raises:
        FormulaError: with line, column and what is legal.
    """
    builder = Builder(vocabulary, text)
    clauses: list[Clause] = []
    taken: set[str] = set()
    for place, node in enumerate(_tree(text).children, start=1):
        assert isinstance(node, Tree)  # the grammar has no other children of `start`
        if _depth(node) > MAX_DEPTH:
            raise builder.error(node, f"this is nested more than {MAX_DEPTH} deep")
        name, attributes, body = _named(node, place, text)
        if name in taken:
            raise builder.error(node, f"two clauses are called '{name}'; names must differ")
        taken.add(name)
        weight, priority = _attributes(builder, attributes)
        formula = builder.formula(body)
        if formula is not None:
            source = " ".join(text[body.meta.start_pos : body.meta.end_pos].split())
            clauses.append(Clause(name, source, formula, weight, priority))
    if not clauses:
        raise FormulaError("no clause says anything about this scenario", text, 1, 1)
    return clauses


def _depth(node: Node) -> int:
    """Levels of the parse tree, counted without recursion."""
    level, depth = [node], 0
    while level:
        level = [child for tree in level for child in tree.children if isinstance(child, Tree)]
        depth += 1
    return depth


def _named(node: Node, place: int, text: str) -> tuple[str, Node | None, Node]:
    """Name, attributes if any, and formula of a clause."""
    *head, last = node.children
    body = as_tree(last)
    if not head:
        return f"c{place}", None, body
    token = as_token(head[0])
    if not is_name(token):
        message = f"'{token}' cannot name a clause; legal: a letter, then up to 31 letters, digits or _"
        raise FormulaError(message, text, token.line or 1, token.column or 1)
    return str(token), as_tree(head[1]) if len(head) > 1 else None, body


def _attributes(builder: Builder, node: Node | None) -> tuple[float, int]:
    """Weight and priority of a clause; 1 and 0 where they are not given."""
    given: dict[str, float] = {}
    for entry in map(as_tree, node.children if node is not None else []):
        key, place = as_token(entry.children[0]), as_tree(entry.children[1])
        if key not in ("weight", "priority"):
            raise builder.error(key, f"'{key}' is not an attribute of a clause; legal: weight, priority")
        if str(key) in given:
            raise builder.error(key, f"the {key} is given twice")
        value = builder.linear(place, {})
        if not value.is_constant:
            raise builder.error(place, f"a {key} is a number")
        given[str(key)] = value.constant
        if key == "weight" and not MIN_WEIGHT <= value.constant <= MAX_WEIGHT:
            legal = f"need a number above 0, from {MIN_WEIGHT:g} to {MAX_WEIGHT:g}"
            raise builder.error(place, f"the weight {value.constant:g} is not legal; {legal}")
        whole = value.constant == math.floor(value.constant)
        if key == "priority" and not (whole and 0 <= value.constant <= MAX_PRIORITY):
            legal = f"need a whole number from 0 to {MAX_PRIORITY}"
            raise builder.error(place, f"the priority {value.constant:g} is not legal; {legal}")
    return given.get("weight", 1.0), int(given.get("priority", 0))


@cache
def _parser() -> Lark:
    grammar = files("fleet.stl").joinpath("grammar.lark").read_text(encoding="utf-8")
    return Lark(grammar, parser="lalr", lexer="basic", propagate_positions=True)


def _tree(text: str) -> Node:
    try:
        return _parser().parse(text)
    except UnexpectedCharacters as error:
        message = f"unexpected character {error.char!r}"
        raise FormulaError(message, text, error.line, error.column) from None
    except UnexpectedToken as error:
        legal = set(error.accepts or error.expected)
        if "NAME" in legal and "NOT" not in legal:
            legal -= _NAMES_TOO
        expected = ", ".join(sorted(map(_display, legal)))
        if error.token.type == "$END":
            lines = text.rstrip().splitlines() or [""]
            raise FormulaError(
                f"the text ends too early; expected {expected}", text, len(lines), len(lines[-1]) + 1
            ) from None
        raise FormulaError(
            f"unexpected '{error.token}'; expected {expected}", text, error.line, error.column
        ) from None


_NAMES_TOO = {"ONCE", "HISTORICALLY", "SINCE", "STAY"}
"""Words that may also name a clause."""


def _display(terminal: str) -> str:
    special = {"NAME": "a name", "NUMBER": "a number", "$END": "the end"}
    if terminal in special:
        return special[terminal]
    return f"'{_parser().get_terminal(terminal).pattern.value}'"
