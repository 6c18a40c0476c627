"""From parse tree to formula: names resolved, quantifiers expanded, windows put on the grid of T_s."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import permutations

from lark import Token

from fleet.stl.arithmetic import Arithmetic, Node, Scope, as_token, as_tree
from fleet.stl.linear import LinearForm
from fleet.stl.vocabulary import RESERVED, Formula, Vocabulary, is_name

MAX_INSTANCES = 100_000
"""Bodies of quantifiers that one text may expand to; 64 drones have 2016 pairs."""


class Builder(Arithmetic):
    """Builds formulas from parse trees of one text; None stands for "true whatever the drones do"."""

    def __init__(self, vocabulary: Vocabulary, text: str) -> None:
        super().__init__(vocabulary, text)
        self._instances = 0

    def formula(self, node: Node, scope: Scope | None = None, offset: float = 0.0) -> Formula | None:
        """The formula of `node`, evaluated `offset` seconds after mission time 0 at the latest.

        Raises:
            FormulaError: unknown names, bad windows, or a window that reaches out of the mission.
        """
        build: Callable[[Node, Scope, float], Formula | None] = getattr(self, f"_{node.data.rstrip('_')}")
        return build(node, scope or {}, offset)

    # -- logic ---------------------------------------------------------------------------------

    def _and(self, node: Node, scope: Scope, offset: float) -> Formula | None:
        parts = [self.formula(as_tree(child), scope, offset) for child in node.children]
        return _conjunction([part for part in parts if part is not None])

    def _or(self, node: Node, scope: Scope, offset: float) -> Formula:
        return {"op": "or", "fs": [self._needed(as_tree(child), scope, offset) for child in node.children]}

    def _not(self, node: Node, scope: Scope, offset: float) -> Formula:
        return {"op": "not", "f": self._needed(as_tree(node.children[0]), scope, offset)}

    def _implies(self, node: Node, scope: Scope, offset: float) -> Formula:
        left, right = (self._needed(as_tree(child), scope, offset) for child in node.children)
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
        window, operand = (as_tree(child) for child in node.children)
        start, end = self._window(window, offset)
        f = self.formula(operand, scope, offset + end)
        return None if f is None else {"op": op, "from": start, "to": end, "f": f}

    def _stay(self, node: Node, scope: Scope, offset: float) -> Formula | None:
        """`stay D f`, for always[0,D] f."""
        length, operand = (as_tree(child) for child in node.children)
        form = self.linear(length, {})
        if not form.is_constant or form.constant < 0:
            shown = f"of {form.constant:g} s " if form.is_constant else ""
            raise self.error(length, f"a stay {shown}is not legal; need a number of seconds of 0 or more")
        self._check_grid(length, form.constant)
        end = self.words.floor(form.constant)
        self._check_end(length, end, offset, "stay")
        f = self.formula(operand, scope, offset + end)
        return None if f is None else {"op": "always", "from": 0.0, "to": end, "f": f}

    def _until(self, node: Node, scope: Scope, offset: float) -> Formula:
        before, window, after = (as_tree(child) for child in node.children)
        start, end = self._window(window, offset)
        left = self._needed(before, scope, offset + end)
        right = self._needed(after, scope, offset + end)
        return {"op": "until", "from": start, "to": end, "left": left, "right": right}

    def _release(self, node: Node, scope: Scope, offset: float) -> Formula:
        """`f release[a,b] g`, for not (not f until[a,b] not g): g over the window, until f held once."""
        f = self._until(node, scope, offset)
        f["left"], f["right"] = ({"op": "not", "f": f[side]} for side in ("left", "right"))
        return {"op": "not", "f": f}

    # -- the past ------------------------------------------------------------------------------

    def _once(self, node: Node, scope: Scope, offset: float) -> Formula | None:
        return self._back("once", node, scope, offset)

    def _historically(self, node: Node, scope: Scope, offset: float) -> Formula | None:
        return self._back("historically", node, scope, offset)

    def _back(self, op: str, node: Node, scope: Scope, offset: float) -> Formula | None:
        window, operand = (as_tree(child) for child in node.children)
        start, end = self._window_back(window, offset)
        f = self.formula(operand, scope, offset - start)
        return None if f is None else {"op": op, "from": start, "to": end, "f": f}

    def _since(self, node: Node, scope: Scope, offset: float) -> Formula:
        kept, window, begun = (as_tree(child) for child in node.children)
        start, end = self._window_back(window, offset)
        left, right = self._needed(kept, scope, offset), self._needed(begun, scope, offset - start)
        return {"op": "since", "from": start, "to": end, "left": left, "right": right}

    def _window_back(self, node: Node, offset: float) -> tuple[float, float]:
        start, end = self._bounds(node)
        if start > offset + 1e-9:
            when = f"at {offset:g} s or earlier" if offset else "at mission time 0"
            raise self.error(
                node, f"the window looks back {start:g} s or more {when}: nothing lies before the mission"
            )
        if end > self.words.T + 1e-9:
            raise self.error(
                node, f"the window looks back {end:g} s; the mission lasts T = {self.words.T:g} s"
            )
        return start, end

    # -- windows -------------------------------------------------------------------------------

    def _window(self, node: Node, offset: float) -> tuple[float, float]:
        start, end = self._bounds(node)
        self._check_end(node, end, offset)
        return start, end

    def _check_end(self, node: Node, end: float, offset: float, what: str = "window") -> None:
        T = self.words.T
        if offset + end > T + 1e-9:
            around = f", inside windows that reach to {offset:g} s" if offset else ""
            raise self.error(node, f"the {what} ends at {end:g} s{around}; the mission ends at T = {T:g} s")

    def _bounds(self, node: Node) -> tuple[float, float]:
        """Start and end of a window, on samples."""
        bounds = []
        for child in node.children:
            form = self.linear(as_tree(child), {})
            if not form.is_constant:
                raise self.error(
                    as_tree(child), "a window's end is a number, built from numbers, T and delta_min"
                )
            self._check_grid(as_tree(child), form.constant)
            bounds.append(form.constant)
        if not 0 <= bounds[0] <= bounds[1] or math.isinf(bounds[1]):
            shown = f"[{bounds[0]:g}, {bounds[1]:g}]"
            raise self.error(node, f"the window {shown} is not legal; need 0 <= start <= end")
        start, end = (self.words.floor(bound) for bound in bounds)
        return start, end

    def _check_grid(self, node: Node, time: float) -> None:
        """A time written as a number must be a sample: rounding would judge another mission than is written.

        Only shares of T are rounded, because 2T/3 can rarely be written as a multiple of T_s.
        """
        step = self.words.T_s
        of_T = any(token == "T" for token in node.scan_values(lambda value: isinstance(value, Token)))
        if of_T or not math.isfinite(time) or time < 0:
            return
        before = self.words.floor(time)
        if time - before > 1e-6 * step:
            legal = f"{before:g} and {before + step:g}"
            raise self.error(
                node, f"{time:g} s is not a multiple of T_s = {step:g} s; next to it are {legal}"
            )

    # -- quantifiers ---------------------------------------------------------------------------

    def _all(self, node: Node, scope: Scope, offset: float) -> Formula | None:
        return _conjunction(self._bodies(node, scope, offset))

    def _some(self, node: Node, scope: Scope, offset: float) -> Formula:
        instances = self._bodies(node, scope, offset)
        if not instances:
            raise self.error(node, "there are not enough drones for this")
        return instances[0] if len(instances) == 1 else {"op": "or", "fs": instances}

    def _bodies(self, node: Node, scope: Scope, offset: float) -> list[Formula]:
        """The body for each drone, or for each pair; both orders only where they differ."""
        *variables, body = node.children
        names = [self._variable(as_token(variable), scope) for variable in variables]
        if len(names) == 2 and names[0] == names[1]:
            raise self.error(
                as_token(variables[1]), f"'{names[1]}' is used twice; the two drones need two names"
            )
        found: dict[str, Formula] = {}
        for drones in permutations(self.words.drones, len(names)):
            self._instances += 1
            if self._instances > MAX_INSTANCES:
                raise self.error(
                    node, f"the quantifiers of this text expand to over {MAX_INSTANCES} formulas"
                )
            inner = {**scope, **dict(zip(names, drones, strict=True))}
            instance = self.formula(as_tree(body), inner, offset)
            if instance is not None:
                found.setdefault(repr(instance), instance)
        return list(found.values())

    def _variable(self, token: Token, scope: Scope) -> str:
        words = self.words
        name = str(token)
        if name in RESERVED or not is_name(name) or name in scope:
            raise self.error(token, f"'{name}' cannot name a drone here; it is reserved or in use")
        if name in (*words.drones, *words.places):
            raise self.error(token, f"'{name}' is a drone or region of the scenario; choose another letter")
        return name

    # -- predicates ----------------------------------------------------------------------------

    def _in(self, node: Node, scope: Scope, _offset: float) -> Formula:
        drone, region = self.drone(as_token(node.children[0]), scope), as_tree(node.children[1])
        if self._is_obstacles(region):
            if not self.words.obstacles:
                raise self.error(region, "the scenario has no obstacles")
            inside: list[Formula] = [{"op": "in", "drone": drone, "region": o} for o in self.words.obstacles]
            return inside[0] if len(inside) == 1 else {"op": "or", "fs": inside}
        return {"op": "in", "drone": drone, "region": self._region(region, drone, scope)}

    def _outside(self, node: Node, scope: Scope, _offset: float) -> Formula | None:
        drone, region = self.drone(as_token(node.children[0]), scope), as_tree(node.children[1])
        if self._is_obstacles(region):
            return _conjunction(
                [{"op": "outside", "drone": drone, "region": o} for o in self.words.obstacles]
            )
        return {"op": "outside", "drone": drone, "region": self._region(region, drone, scope)}

    @staticmethod
    def _is_obstacles(region: Node) -> bool:
        return [str(part) for part in region.children] == ["obstacles"]

    def _region(self, node: Node, drone: str, scope: Scope) -> str:
        words = self.words
        name, *owner = (as_token(part) for part in node.children)
        if owner:
            if name != "home":
                raise self.error(
                    node, f"'{name}.{owner[0]}' is not a region; only homes are written home.DRONE"
                )
            return f"home.{self.drone(owner[0], scope)}"
        if name == "home":
            return f"home.{drone}"
        if name == "workspace" or name in words.places:
            return str(name)
        legal = ", ".join(("workspace", "obstacles", "home", *words.places))
        raise self.error(name, f"'{name}' is not a region of the scenario; legal: {legal}")

    def _ge(self, node: Node, scope: Scope, _offset: float) -> Formula:
        left, right = (self.linear(as_tree(child), scope) for child in node.children)
        return self._comparison(left - right, node)

    def _le(self, node: Node, scope: Scope, _offset: float) -> Formula:
        left, right = (self.linear(as_tree(child), scope) for child in node.children)
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


def _conjunction(parts: list[Formula]) -> Formula | None:
    if len(parts) <= 1:
        return parts[0] if parts else None
    return {"op": "and", "fs": parts}
