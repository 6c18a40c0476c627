"""Random formulas over three drones, as trees that the parser itself would make."""

from hypothesis import strategies as st

DRONES = ("d1", "d2", "d3")
REGIONS = ("workspace", "tower", "cable", "tr1", "tr2", "home.d1", "home.d2", "home.d3")
T_S = 0.05

_drone, _region = st.sampled_from(DRONES), st.sampled_from(REGIONS)
_number = st.floats(-1e6, 1e6, allow_nan=False).map(lambda x: x + 0.0)
_coef = _number.filter(lambda x: x != 0)


def _pair():
    return st.sampled_from([("d1", "d2"), ("d1", "d3"), ("d2", "d3")])


def predicates():
    """`in`, `outside`, `dist` with the drones in order, `linear` with each coordinate once."""
    place = st.builds(
        lambda op, drone, region: {"op": op, "drone": drone, "region": region},
        st.sampled_from(["in", "outside"]),
        _drone,
        _region,
    )
    apart = st.builds(
        lambda pair, cmp, value: {"op": "dist", "a": pair[0], "b": pair[1], "cmp": cmp, "value": value},
        _pair(),
        st.sampled_from(["ge", "le"]),
        st.floats(0, 100).map(abs),
    )
    coordinates = st.lists(st.tuples(_drone, st.sampled_from("xyz")), min_size=1, max_size=3, unique=True)
    row = st.builds(
        lambda names, coefs, constant: {
            "op": "linear",
            "terms": [
                {"drone": d, "axis": x, "coef": coef} for (d, x), coef in zip(names, coefs, strict=False)
            ],
            "constant": constant,
        },
        coordinates,
        st.lists(_coef, min_size=3, max_size=3),
        _number,
    )
    return st.one_of(place, apart, row)


@st.composite
def formulas(draw, depth=3, steps=1200):
    """A formula of at most `depth` operators, one in the other, and a horizon of at most `steps` x T_S."""
    op = draw(st.sampled_from(["predicate", "not", "and", "or", "implies", "always", "eventually", "until"]))
    if depth == 0 or op == "predicate":
        return draw(predicates())
    if op in {"always", "eventually", "until"}:
        start = draw(st.integers(0, steps // 2))
        end = draw(st.integers(start, max(start, steps // 2)))
        window = {"op": op, "from": round(start * T_S, 9), "to": round(end * T_S, 9)}
        inner = formulas(depth=depth - 1, steps=steps - end)
        if op == "until":
            return {**window, "left": draw(inner), "right": draw(inner)}
        return {**window, "f": draw(inner)}
    inner = formulas(depth=depth - 1, steps=steps)
    if op == "not":
        return {"op": op, "f": draw(inner)}
    if op == "implies":
        return {"op": op, "left": draw(inner), "right": draw(inner)}
    return {"op": op, "fs": draw(st.lists(inner, min_size=2, max_size=3))}
