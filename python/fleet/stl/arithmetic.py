"""Names of drones and numbers in formulas: `2T/3`, `d1.x - 2*d2.z`, `dist(d1, d2)`."""

from __future__ import annotations

from collections.abc import Mapping

from lark import Token, Tree

from fleet.errors import FormulaError
from fleet.stl.linear import LinearForm
from fleet.stl.vocabulary import Vocabulary

Node = Tree[Token]
Scope = Mapping[str, str]
"""Variables of the quantifiers around a node, and the drone that each stands for."""

AXES = ("x", "y", "z")


def as_tree(child: Token | Node) -> Node:
    """The child of a node where the grammar has a rule."""
    assert isinstance(child, Tree)  # a token here would be a mistake in grammar.lark
    return child


def as_token(child: Token | Node) -> Token:
    """The child of a node where the grammar has a terminal."""
    assert isinstance(child, Token)  # a rule here would be a mistake in grammar.lark
    return child


class Arithmetic:
    """Reads the linear forms of one text."""

    def __init__(self, vocabulary: Vocabulary, text: str) -> None:
        """With the text itself, for errors that show its lines."""
        self.words = vocabulary
        self._text = text
        self._order = {drone: i for i, drone in enumerate(vocabulary.drones)}

    def error(self, place: Node | Token, message: str) -> FormulaError:
        """A FormulaError that points at `place`."""
        meta = place.meta if isinstance(place, Tree) else place
        return FormulaError(message, self._text, meta.line or 1, meta.column or 1)

    def drone(self, token: Token, scope: Scope) -> str:
        """The id of the drone that a name stands for.

        Raises:
            FormulaError: it is neither a variable of `scope` nor a drone.
        """
        name = str(token)
        if name in scope:
            return scope[name]
        if name in self._order:
            return name
        legal = ", ".join((*self.words.drones, *scope))
        raise self.error(token, f"'{name}' is not a drone here; legal: {legal}")

    def linear(self, node: Node, scope: Scope) -> LinearForm:
        """The linear form of an arithmetic expression.

        Raises:
            FormulaError: unknown names, products of coordinates, division by zero, overflow.
        """
        rule, parts = node.data, node.children
        if rule in {"add", "sub", "mul", "div", "neg"}:
            form = self._operation(node, [self.linear(as_tree(part), scope) for part in parts])
        elif rule == "dist":
            form = self._distance(node, scope)
        elif rule == "coordinate":
            form = self._coordinate(as_token(parts[0]), as_token(parts[1]), scope)
        elif rule == "scaled":  # a number before a name, as in 2T
            form = LinearForm(self._symbol(as_token(parts[1]))).scaled(float(as_token(parts[0])))
        else:
            token = as_token(parts[0])
            form = LinearForm(float(token) if rule == "number" else self._symbol(token))
        if not form.is_finite:
            raise self.error(node, "this number is too large")
        return form

    def _operation(self, node: Node, operands: list[LinearForm]) -> LinearForm:
        left, right = operands[0], operands[-1]
        if node.data == "neg":
            return left.scaled(-1.0)
        if node.data == "add":
            return left + right
        if node.data == "sub":
            return left - right
        if node.data == "mul":
            if left.is_constant:
                return right.scaled(left.constant)
            if right.is_constant:
                return left.scaled(right.constant)
            raise self.error(node, "the product of two coordinates is not linear")
        if not right.is_constant or right.constant == 0:
            raise self.error(node, "only division by a number other than 0 is legal")
        return left.scaled(1.0, right.constant)

    def _distance(self, node: Node, scope: Scope) -> LinearForm:
        """The distance of two drones, named in the scenario's order: it is the same both ways."""
        a, b = sorted(
            (self.drone(as_token(part), scope) for part in node.children), key=self._order.__getitem__
        )
        if a == b:
            raise self.error(node, f"the distance of '{a}' to itself is always 0")
        return LinearForm(0.0, distances={(a, b): 1.0})

    def _coordinate(self, drone: Token, axis: Token, scope: Scope) -> LinearForm:
        if axis not in AXES:
            raise self.error(axis, f"'{axis}' is not a coordinate; legal: {', '.join(AXES)}")
        return LinearForm(0.0, coordinates={(self.drone(drone, scope), str(axis)): 1.0})

    def _symbol(self, token: Token) -> float:
        known = {"T": self.words.T, "delta_min": self.words.delta_min}
        if token not in known:
            legal = f"{', '.join(known)}, and d.x of a drone d"
            raise self.error(token, f"'{token}' is not a number here; legal: {legal}")
        return known[str(token)]
