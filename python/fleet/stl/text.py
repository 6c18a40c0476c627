"""From text to clauses: the grammar of `grammar.lark` with errors that say where and what is legal."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

from lark import Lark, Token, Tree
from lark.exceptions import UnexpectedCharacters, UnexpectedToken

from fleet.errors import FormulaError
from fleet.stl.arithmetic import Node
from fleet.stl.build import Builder
from fleet.stl.vocabulary import Clause, Vocabulary, is_name

MAX_DEPTH = 64
"""Nesting that is still read; every reader of a plan recurses over its formulas."""


def parse(text: str, vocabulary: Vocabulary) -> list[Clause]:
    """Reads a mission: clauses `@name f`, or `f` alone, separated by `;` or by the next `@`.

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
        name, body = _named(node, place, text)
        if name in taken:
            raise builder.error(node, f"two clauses are called '{name}'; names must differ")
        taken.add(name)
        formula = builder.formula(body)
        if formula is not None:
            source = text[body.meta.start_pos : body.meta.end_pos]
            clauses.append(Clause(name, " ".join(source.split()), formula))
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


def _named(node: Node, place: int, text: str) -> tuple[str, Node]:
    *name, body = node.children
    assert isinstance(body, Tree)  # the grammar ends both rules with a formula
    if not name:
        return f"c{place}", body
    token = name[0]
    assert isinstance(token, Token)  # the grammar puts NAME first
    if not is_name(token):
        message = f"'{token}' cannot name a clause; legal: a letter, then up to 31 letters, digits or _"
        raise FormulaError(message, text, token.line or 1, token.column or 1)
    return str(token), body


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
        expected = ", ".join(sorted(_display(name) for name in error.accepts or error.expected))
        if error.token.type == "$END":
            lines = text.rstrip().splitlines() or [""]
            raise FormulaError(
                f"the text ends too early; expected {expected}", text, len(lines), len(lines[-1]) + 1
            ) from None
        raise FormulaError(
            f"unexpected '{error.token}'; expected {expected}", text, error.line, error.column
        ) from None


def _display(terminal: str) -> str:
    special = {"NAME": "a name", "NUMBER": "a number", "$END": "the end"}
    if terminal in special:
        return special[terminal]
    return f"'{_parser().get_terminal(terminal).pattern.value}'"
