"""The paper's mission formula for a scenario that has none (design.md, Text syntax)."""

from __future__ import annotations

from collections.abc import Container

from fleet.stl.vocabulary import Vocabulary


def default_formula(vocabulary: Vocabulary) -> str:
    """The mission as text: stay safe and apart, visit each target by 2T/3, be home from then to T.

    Paper, section IV-A, with its `eventually ... until home` read as its figures show it: each
    target within [0, 2T/3] by some drone, then all drones home within [2T/3, T].
    """
    used = {*vocabulary.drones, *vocabulary.targets, *vocabulary.obstacles}
    d, e = _free("d", used), _free("e", used)
    around = f" and {d} outside obstacles" if vocabulary.obstacles else ""
    lines = [f"@safe  always[0,T] all {d}: {d} in workspace{around}"]
    if len(vocabulary.drones) > 1:
        lines.append(f"@apart always[0,T] all {d} != {e}: dist({d},{e}) >= delta_min")
    for target in vocabulary.targets:
        clause = _free(target, {"safe", "apart"})
        lines.append(f"@{clause:5} eventually[0,2T/3] some {d}: {d} in {target}")
    # `home` is a reserved word for regions and variables; as the name of a clause it is free.
    lines.append(f"@home  eventually[2T/3,T] all {d}: {d} in home")
    return "\n".join(lines) + "\n"


def _free(name: str, used: Container[str]) -> str:
    while name in used:
        name += "_"
    return name
