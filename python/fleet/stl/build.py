"""From parse tree to formula: names resolved, quantifiers expanded, windows put on the grid of T_s."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import combinations

from lark import Token, Tree

from fleet.errors import FormulaError
from fleet.stl.linear import LinearForm
from fleet.stl.vocabulary import RESERVED, Formula, Vocabulary, is_name

Node = Tree[Token]
Scope = Mapping[str, str]
"""Variables of the quantifiers around a node, and the drone that each stands for."""


class Builder:
    """Builds formulas from parse trees of one text; None stands for "true whatever the drones do"."""

    def __init__(self, vocabulary: Vocabulary, text: str) -> None:
        self._words = vocabulary
        self._text = text
        self._order = {drone: i for i, drone in enumerate(vocabulary.drones)}

    def error(self, place: Node | Token, message: str) -> FormulaError:
        """A FormulaError that points at `place`."""
        meta = place.meta if isinstance(place, Tree) else place
        return FormulaError(message, self._text, meta.line or 1, meta.column or 1)

    def formula(self, node: Node, scope: Scope | None = None, offset: float = 0.0) -> Formula | None:
        """The formula of `node`, evaluated `offset` seconds or less after mission time 0.

        Raises:
            FormulaError: unknown names, bad windows, or a window that reaches beyond T.
        """
        build: Callable[[Node, Scope, float], Formula | None] = getattr(self, f"_{node.data.rstrip('_')}")
        return build(node, scope or {}, offset)

    # -- logic ---------------------------------------------------------------------------------

    def _and(self, node: Node, scope: Scope, offset: float) -> Formula | None:
        parts = [self.formula(_tree(child), scope, offset) for child in node.children]
        return _conjunction([part for part in parts if part is not None])

    def _or(self, node: Node, scope: Scope, offset: float) -> Formula:
        return {"op": "or", "fs": [self._needed(_tree(child), scope, offset) for child in node.children]}

    def _not(self, node: Node, scope: Scope, offset: float) -> Formula:
        return {"op": "not", "f": self._needed(_tree(node.children[0]), scope, offset)}

    def _implies(self, node: Node, scope: Scope, offset: float) -> Formula:
        left, right = (self._needed(_tree(child), scope, offset) for child in node.children)
        return {"op": "implies", "left": left, "right": right}

    def _needed(self, node: Node, scope: Scope, offset: float) -> Formula:
        formula = self.formula(node, scope, offset)
        if formula is None:
            raise self.error(node, "this is true in any case (no obstacles, or no two drones); leave it out")
        return formula

    # -- time ----------------------------------------------------------------------------------

    def _always(self, node: Node, scope: Scope, offset: float) -> Formula | None:
        return self._unary("always", node, scope, offset)

    def _eventually(self, node: Node, scope: Scope, offset: float) -> Formula | None:
        return self._unary("eventually", node, scope, offset)

    def _unary(self, op: str, node: Node, scope: Scope, offset: float) -> Formula | None:
        window, operand = (_tree(child) for child in node.children)
        start, end = self._window(window, offset)
        f = self.formula(operand, scope, offset + end)
        return None if f is None else {"op": op, "from": start, "to": end, "f": f}

    def _until(self, node: Node, scope: Scope, offset: float) -> Formula:
        before, window, after = (_tree(child) for child in node.children)
        start, end = self._window(window, offset)
        left = self._needed(before, scope, offset + end)
        right = self._needed(after, scope, offset + end)
        return {"op": "until", "from": start, "to": end, "left": left, "right": right}

    def _window(self, node: Node, offset: float) -> tuple[float, float]:
        bounds = []
        for child in node.children:
            form = self._linear(_tree(child), {})
            if not form.is_constant:
                raise self.error(
                    _tree(child), "a window's end is a number, built from numbers, T and delta_min"
                )
            bounds.append(form.constant)
        T = self._words.T
        if not 0 <= bounds[0] <= bounds[1] or math.isinf(bounds[1]):
            shown = f"[{bounds[0]:g}, {bounds[1]:g}]"
            raise self.error(node, f"the window {shown} is not legal; need 0 <= start <= end")
        start, end = (self._words.floor(bound) for bound in bounds)
        if offset + end > T + 1e-9:
            around = f" inside windows that reach to {offset:g} s" if offset else ""
            message = (
                f"the window ends at {end:g} s{around}: {offset + end:g} s, beyond the mission's T = {T:g} s"
            )
            raise self.error(node, message)
        return start, end

    # -- quantifiers ---------------------------------------------------------------------------

    def _all(self, node: Node, scope: Scope, offset: float) -> Formula | None:
        return _conjunction(self._instances(node, scope, offset))

    def _some(self, node: Node, scope: Scope, offset: float) -> Formula:
        instances = self._instances(node, scope, offset)
        if not instances:
            raise self.error(node, "there are not enough drones for this")
        return instances[0] if len(instances) == 1 else {"op": "or", "fs": instances}

    def _instances(self, node: Node, scope: Scope, offset: float) -> list[Formula]:
        """The body for each drone, or for each pair; both orders only where they differ."""
        *variables, body = node.children
        names = [self._variable(_token(variable), scope) for variable in variables]
        if len(names) == 2 and names[0] == names[1]:
            raise self.error(
                _token(variables[1]), f"'{names[1]}' is used twice; the two drones need two names"
            )
        found: list[Formula] = []
        for drones in combinations(self._words.drones, len(names)):
            for order in (drones, drones[::-1]):
                instance = self.formula(
                    _tree(body), {**scope, **dict(zip(names, order, strict=True))}, offset
                )
                if instance is not None and instance not in found:
                    found.append(instance)
        return found

    def _variable(self, token: Token, scope: Scope) -> str:
        words = self._words
        name = str(token)
        if name in RESERVED or not is_name(name) or name in scope:
            raise self.error(token, f"'{name}' cannot name a drone here; it is reserved or in use")
        if name in (*words.drones, *words.targets, *words.obstacles):
            raise self.error(token, f"'{name}' is a drone or region of the scenario; choose another letter")
        return name

    # -- predicates ----------------------------------------------------------------------------

    def _in(self, node: Node, scope: Scope, _offset: float) -> Formula:
        drone, region = self._drone(_token(node.children[0]), scope), _tree(node.children[1])
        if self._is_obstacles(region):
            if not self._words.obstacles:
                raise self.error(region, "the scenario has no obstacles")
            inside: list[Formula] = [{"op": "in", "drone": drone, "region": o} for o in self._words.obstacles]
            return inside[0] if len(inside) == 1 else {"op": "or", "fs": inside}
        return {"op": "in", "drone": drone, "region": self._region(region, drone, scope)}

    def _outside(self, node: Node, scope: Scope, _offset: float) -> Formula | None:
        drone, region = self._drone(_token(node.children[0]), scope), _tree(node.children[1])
        if self._is_obstacles(region):
            return _conjunction(
                [{"op": "outside", "drone": drone, "region": o} for o in self._words.obstacles]
            )
        return {"op": "outside", "drone": drone, "region": self._region(region, drone, scope)}

    @staticmethod
    def _is_obstacles(region: Node) -> bool:
        return [str(part) for part in region.children] == ["obstacles"]

    def _region(self, node: Node, drone: str, scope: Scope) -> str:
        words = self._words
        name, *owner = (_token(part) for part in node.children)
        if owner:
            if name != "home":
                raise self.error(
                    node, f"'{name}.{owner[0]}' is not a region; only homes are written home.DRONE"
                )
            return f"home.{self._drone(owner[0], scope)}"
        if name == "home":
            return f"home.{drone}"
        if name == "workspace" or name in words.targets or name in words.obstacles:
            return str(name)
        legal = ", ".join(("workspace", "obstacles", "home", *words.targets, *words.obstacles))
        raise self.error(name, f"'{name}' is not a region of the scenario; legal: {legal}")

    def _drone(self, token: Token, scope: Scope) -> str:
        name = str(token)
        if name in scope:
            return scope[name]
        if name in self._order:
            return name
        legal = ", ".join((*self._words.drones, *scope))
        raise self.error(token, f"'{name}' is not a drone here; legal: {legal}")

    def _ge(self, node: Node, scope: Scope, _offset: float) -> Formula:
        left, right = (self._linear(_tree(child), scope) for child in node.children)
        return self._comparison(left - right, node)

    def _le(self, node: Node, scope: Scope, _offset: float) -> Formula:
        left, right = (self._linear(_tree(child), scope) for child in node.children)
        return self._comparison(right - left, node)

    def _comparison(self, form: LinearForm, node: Node) -> Formula:
        """`form >= 0` as a distance or a linear predicate."""
        if form.is_constant:
            raise self.error(node, "this compares numbers only; name a drone's coordinate or a distance")
        if not form.distances:
            return form.predicate()
        if form.coordinates or len(form.distances) > 1:
            raise self.error(node, "a distance is compared with a number alone, such as dist(d1, d2) >= 3")
        ((a, b), factor) = next(iter(form.distances.items()))
        value = -form.constant / factor
        if value < 0:
            raise self.error(node, f"a distance is never below {value:g}; compare with a number >= 0")
        return {"op": "dist", "a": a, "b": b, "cmp": "ge" if factor > 0 else "le", "value": value + 0.0}

    # -- arithmetic ----------------------------------------------------------------------------

    def _linear(self, node: Node, scope: Scope) -> LinearForm:
        rule, parts = node.data.rstrip("_"), node.children
        if rule in {"add", "sub", "mul", "div"}:
            left, right = (self._linear(_tree(part), scope) for part in parts)
            form = self._combine(rule, left, right, node)
            if not form.is_finite:
                raise self.error(node, "this number is too large")
            return form
        if rule == "neg":
            return self._linear(_tree(parts[0]), scope).scaled(-1.0)
        if rule == "number":
            return LinearForm(self._number(_token(parts[0])))
        if rule == "scaled":
            return LinearForm(self._symbol(_token(parts[1]))).scaled(self._number(_token(parts[0])))
        if rule == "symbol":
            return LinearForm(self._symbol(_token(parts[0])))
        if rule == "dist":
            a, b = sorted((self._drone(_token(part), scope) for part in parts), key=self._order.__getitem__)
            if a == b:
                raise self.error(node, f"the distance of '{a}' to itself is always 0")
            return LinearForm(0.0, distances={(a, b): 1.0})
        drone, axis = (_token(part) for part in parts)
        if axis not in {"x", "y", "z"}:
            raise self.error(axis, f"'{axis}' is not a coordinate; legal: x, y, z")
        return LinearForm(0.0, coordinates={(self._drone(drone, scope), str(axis)): 1.0})

    def _combine(self, rule: str, left: LinearForm, right: LinearForm, node: Node) -> LinearForm:
        if rule == "add":
            return left + right
        if rule == "sub":
            return left - right
        if rule == "mul":
            if not (left.is_constant or right.is_constant):
                raise self.error(node, "the product of two coordinates is not linear")
            return right.scaled(left.constant) if left.is_constant else left.scaled(right.constant)
        if not right.is_constant or right.constant == 0:
            raise self.error(node, "only division by a number other than 0 is legal")
        return left.scaled(1.0, right.constant)

    def _number(self, token: Token) -> float:
        value = float(token)
        if not math.isfinite(value):
            raise self.error(token, f"{token} is too large")
        return value

    def _symbol(self, token: Token) -> float:
        known = {"T": self._words.T, "delta_min": self._words.delta_min}
        if token not in known:
            raise self.error(
                token, f"'{token}' is not a number here; legal: {', '.join(known)}, and d.x of a drone d"
            )
        return known[str(token)]


def _conjunction(parts: list[Formula]) -> Formula | None:
    if len(parts) <= 1:
        return parts[0] if parts else None
    return {"op": "and", "fs": parts}


def _tree(child: Token | Node) -> Node:
    assert isinstance(child, Tree)  # a token here would be a mistake in grammar.lark
    return child


def _token(child: Token | Node) -> Token:
    assert isinstance(child, Token)  # a rule here would be a mistake in grammar.lark
    return child
