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


def operators(inner, windows, *, past=False, least=1):
    """Every operator over operands `inner`, with `windows` {from, to}; junctions of at least `least`."""
    binary = st.sampled_from(["until", "since"] if past else ["until"])
    unary = ["always", "eventually", *(["once", "historically"] if past else [])]
    lists = st.lists(inner, min_size=least, max_size=3)
    return st.one_of(
        st.builds(lambda f: {"op": "not", "f": f}, inner),
        st.builds(lambda op, fs: {"op": op, "fs": fs}, st.sampled_from(["and", "or"]), lists),
        st.builds(lambda left, right: {"op": "implies", "left": left, "right": right}, inner, inner),
        st.builds(lambda op, w, f: {"op": op, **w, "f": f}, st.sampled_from(unary), windows, inner),
        st.builds(
            lambda op, w, left, right: {"op": op, **w, "left": left, "right": right},
            binary,
            windows,
            inner,
            inner,
        ),
    )


def horizon(f, sample):
    """How many samples ahead a formula looks."""
    if f["op"] in {"once", "historically"}:
        return max(0, horizon(f["f"], sample) - round(f["from"] / sample))
    if f["op"] == "since":
        later = horizon(f["right"], sample) - round(f["from"] / sample)
        return max(horizon(f["left"], sample), later)
    inner = [f[key] for key in ("f", "left", "right") if key in f] + f.get("fs", [])
    return round(f.get("to", 0.0) / sample) + max((horizon(g, sample) for g in inner), default=0)


FUTURE, PAST = ("always", "eventually", "until"), ("once", "historically", "since")


@st.composite
def formulas(draw, depth=3, steps=1200, now=0):
    """A formula as the parser reads it in a mission of `now` + `steps` samples of T_S.

    At most `depth` operators, one in the other; evaluated at sample `now` at the latest.
    """
    op = draw(st.sampled_from(["predicate", "not", "and", "or", "implies", *FUTURE, *PAST]))
    if depth == 0 or op == "predicate":
        return draw(predicates())
    if op in FUTURE:
        start = draw(st.integers(0, steps // 2))
        end = draw(st.integers(start, max(start, steps // 2)))
        left = right = formulas(depth=depth - 1, steps=steps - end, now=now + end)
    elif op in PAST:
        start = draw(st.integers(0, now))
        end = draw(st.integers(start, now + steps))
        left = formulas(depth=depth - 1, steps=steps, now=now)
        right = formulas(depth=depth - 1, steps=steps + start, now=now - start)
    if op in {*FUTURE, *PAST}:
        window = {"op": op, "from": round(start * T_S, 9), "to": round(end * T_S, 9)}
        if op in {"until", "since"}:
            return {**window, "left": draw(left), "right": draw(right)}
        return {**window, "f": draw(right)}
    inner = formulas(depth=depth - 1, steps=steps, now=now)
    if op == "not":
        return {"op": op, "f": draw(inner)}
    if op == "implies":
        return {"op": op, "left": draw(inner), "right": draw(inner)}
    return {"op": op, "fs": draw(st.lists(inner, min_size=2, max_size=3))}
