"""The plan of least violation: visits that come late, or not at all, when the mission cannot hold.

Only visits give way: their deadline is put off as little as possible, T at most, and where that does not
help they are left out. Safety, separation, limits and clauses without a normal form never do. What gives
way is a least hitting set of the conflicts (implicit hitting sets; Reiter 1987, Moreno-Centeno and Karp
2013): conflicts are collected until a mission that hits all of them has a plan.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from fleet import _core
from fleet.errors import InfeasibleError

from .conflict import Court
from .deadline import Deadlines
from .problem import Problem
from .result import PlanResult, Status, encoded
from .spec import Visit
from .subset import irreducible, subset
from .trial import BUDGET, Trials

#: What a visit does: it is on time, may come late, or is left out.
ON_TIME, LATE, SKIPPED = 0, 1, 2
#: Conflicts that are collected at most.
CONFLICTS = 60
#: Times that deadlines are put off further when the planner needs more than the trials did.
FURTHER = 4
#: How much they are put off then [s], doubled every time.
STEP = 0.5
#: Delays are found to within this [s].
FINE = 0.1
#: Steps that all trials of a relaxation may take, as `BUDGET` of one search.
STEPS = 4 * BUDGET

#: What each visit does, by its number.
Actions = tuple[int, ...]


@dataclass(frozen=True)
class GaveWay:
    """A clause that gave way: `how` is "late" (by `by_s` seconds at most) or "skipped"; `regions` which."""

    clause: str
    how: str
    by_s: float | None
    regions: tuple[str, ...]
    t: float | None = None

    def __str__(self) -> str:
        where = ", ".join(self.regions)
        named = self.clause if self.clause == where else f"{self.clause} ({where})"
        if self.how == "skipped":
            return f"{named}: skipped"
        return f"{named}: reached at {self.t:.1f} s, {self.by_s:.1f} s late"

    def as_dict(self) -> dict[str, str | float | None]:
        """One of `relaxed` of `plan --json`."""
        return {"clause": self.clause, "how": self.how, "by_s": self.by_s}


@dataclass
class Relaxation:
    """The search for what gives way in one mission."""

    court: Court
    cores: list[frozenset[tuple[int, int]]] = field(default_factory=list)
    left: int = STEPS

    @property
    def visits(self) -> list[Visit]:
        """The visits of the mission as it is written."""
        return self.court.task.spec.visits

    def task(self, actions: Actions, ends: Mapping[int, float] | None = None) -> Problem:
        """The problem in which visits do what `actions` say, late ones up to `ends` [s], T if not given."""
        task = self.court.task
        ends = ends or {}
        visits = [
            v if act == ON_TIME else replace(v, window=(v.window[0], ends.get(e, task.horizon)))
            for e, (v, act) in enumerate(zip(self.visits, actions, strict=True))
            if act != SKIPPED
        ]
        excused = frozenset(v.clause for v, act in zip(self.visits, actions, strict=True) if act != ON_TIME)
        return replace(task, spec=replace(task.spec, visits=visits), excused=excused)

    def mildest(self, refusal: InfeasibleError) -> Actions:
        """Actions of least violation for which a trial finds a plan.

        Raises the refusal when what conflicts is nothing that may give way.
        """
        actions: Actions = (ON_TIME,) * len(self.visits)
        known = refusal.conflict
        seed = known.clauses if known is not None and (known.proved or known.minimal) else None
        for _ in range(CONFLICTS):
            core = self.core(actions, seed)
            if core is None:
                return actions
            if not core:
                break
            self.cores.append(core)
            options = hitting(self.cores, self.ranks())
            actions = min(options, key=lambda option: (self.delay(option), option))
            seed = None
        refusal.add_note("  nothing that may give way (the times of visits) was found to resolve this")
        raise refusal

    def ranks(self) -> list[tuple[int, bool]]:
        """Priority of every visit, and whether it is one of coming home, which gives way last."""
        priority = {c.id: c.priority for c in self.court.scenario.clauses()}
        homes = self.court.task.homes
        return [(priority[v.clause], all(r in homes for _, r in v.options)) for v in self.visits]

    def core(self, actions: Actions, seed: tuple[str, ...] | None) -> frozenset[tuple[int, int]] | None:
        """What would resolve a conflict that these actions leave; None when a trial finds a plan.

        `seed` has clauses that are known to conflict.
        """
        task = self.task(actions)
        court = Court(self.court.scenario, task)
        found = next(court.impossible(task), None)
        if found is not None:
            least = irreducible(found.clauses, court.hopeless)
            return self.strengthened(
                actions, least, lambda part: next(court.impossible(part), None) is not None
            )
        trials = Trials(task, left=self.left, tell=self.court.tell)
        giving = tuple(dict.fromkeys(v.clause for v in task.spec.visits))
        kept = tuple(c for c in task.spec.kinds if c not in giving)
        if seed is None:
            if trials.plans((*kept, *giving)):
                return None
            nearby = tuple(c for c in giving if c in trials.failing)
            giving = giving if trials.plans((*kept, *nearby)) else nearby
            seed = irreducible(giving, lambda some: not trials.plans((*kept, *some)))
        core = self.strengthened(actions, (*kept, *seed), lambda part: not trials.succeeds(part))
        self.left = trials.left
        return core

    def strengthened(
        self, actions: Actions, clauses: tuple[str, ...], bad: Callable[[Problem], bool]
    ) -> frozenset[tuple[int, int]]:
        """What would resolve the conflict of these clauses: a visit's delay only where that may help."""
        ranks, out = self.ranks(), set()
        mine = [e for e, v in enumerate(self.visits) if v.clause in clauses and actions[e] != SKIPPED]
        for e in sorted(mine, key=lambda e: ranks[e], reverse=True):
            later = (*actions[:e], LATE, *actions[e + 1 :])
            if actions[e] == ON_TIME and not bad(subset(self.task(later), clauses)):
                out.add((e, LATE))
            else:
                actions = later
                out.add((e, SKIPPED))
        return frozenset(out)

    def delay(self, actions: Actions) -> float:
        """Lower bound [s] of how late the latest visit comes; infinite when these actions do not help."""
        return Deadlines(self.task(actions), self.due(actions)).least()

    def due(self, actions: Actions) -> list[float | None]:
        """Deadlines [s] of the late ones among the visits that are left, None for those on time."""
        left = [(v, act) for v, act in zip(self.visits, actions, strict=True) if act != SKIPPED]
        return [v.window[1] if act == LATE else None for v, act in left]

    def ends(self, actions: Actions) -> dict[int, float]:
        """Put-off deadlines [s] of the late visits: the largest delay as small as possible, then each."""
        late = [e for e, act in enumerate(actions) if act == LATE]
        if not late:
            return {}
        least = Deadlines(self.task(actions), self.due(actions)).least()
        trials = Trials(self.court.task, left=self.left, tell=self.court.tell)

        def works(delays: Mapping[int, float]) -> bool:
            ends = {e: self.end(e, delay) for e, delay in delays.items()}
            return trials.succeeds(self.task(actions, ends))

        most = self.court.task.horizon
        common = smallest(lambda d: works(dict.fromkeys(late, d)), least if np.isfinite(least) else 0.0, most)
        delays = dict.fromkeys(late, common)
        ranks = self.ranks()
        for e in sorted(late, key=lambda e: ranks[e], reverse=True) if len(late) > 1 else []:
            others = {k: delay for k, delay in delays.items() if k != e}
            one = partial(alone, works, others, e)
            if one(max(common - FINE, 0.0)):
                delays[e] = smallest(one, 0.0, common)
        self.left = trials.left
        return {e: self.end(e, delay) for e, delay in delays.items()}

    def end(self, visit: int, delay: float) -> float:
        """A deadline put off by `delay` [s]: a sample, T at most."""
        T_s, T = self.court.task.sample, self.court.task.horizon
        end = np.ceil((self.visits[visit].window[1] + delay) / T_s - 1e-6) * T_s
        return float(min(round(float(end), 9), T))

    def gave_way(self, actions: Actions, found: PlanResult) -> Iterator[GaveWay]:
        """What gave way in a plan, clause by clause."""
        for clause in dict.fromkeys(v.clause for v in self.visits):
            mine = [(v, act) for v, act in zip(self.visits, actions, strict=True) if v.clause == clause]
            skipped = [regions_of(v) for v, act in mine if act == SKIPPED]
            if skipped:
                yield GaveWay(clause, "skipped", None, tuple(skipped))
                continue
            late = [
                (t - v.window[1], t, region) for v, act in mine if act == LATE for t, region in made(v, found)
            ]
            late = [one for one in late if one[0] > 1e-9]
            if late:
                by, t, _ = max(late)
                yield GaveWay(clause, "late", round(by, 9), tuple(r for _, _, r in late), t)


def regions_of(visit: Visit) -> str:
    """The regions of a visit's options."""
    return " or ".join(dict.fromkeys(region for _, region in visit.options))


def made(visit: Visit, found: PlanResult) -> list[tuple[float, str]]:
    """Time [s] and region of the first event of a plan that is this visit."""
    times = [
        (float(e["t"]), str(e["region"]))
        for e in found.events
        if (e["drone"], e["region"]) in visit.options and e["window"][0] == visit.window[0]
    ]
    return [min(times)] if times else []


def alone(
    works: Callable[[Mapping[int, float]], bool], others: Mapping[int, float], e: int, d: float
) -> bool:
    """Whether a delay `d` [s] of visit `e` works with those of the others."""
    return works({**others, e: d})


def smallest(works: Callable[[float], bool], low: float, most: float) -> float:
    """A small delay [s] that works, within `FINE`; `most` when nothing smaller was found to work.

    The first is `low`, which nothing less than works.
    """
    if works(low):
        return low
    step, high = STEP, min(low + STEP, most)
    while high < most and not works(high):
        low, step = high, 2 * step
        high = min(low + step, most)
    while high - low > FINE:
        middle = (low + high) / 2
        low, high = (low, middle) if works(middle) else (middle, high)
    return high


def hitting(cores: Sequence[frozenset[tuple[int, int]]], ranks: Sequence[tuple[int, bool]]) -> list[Actions]:
    """All least sets of actions that resolve every conflict.

    A conflict lists what would resolve it: a visit that is at least late, or one that is skipped. Least is,
    from the highest rank down, first the number of visits skipped, then that of late ones.
    """
    levels = sorted(set(ranks), reverse=True)
    best: list[Actions] = []
    least: tuple[int, ...] | None = None
    seen: set[Actions] = set()

    def cost(actions: Actions) -> tuple[int, ...]:
        out: list[int] = []
        for level in levels:
            mine = [act for act, rank in zip(actions, ranks, strict=True) if rank == level]
            out += [mine.count(SKIPPED), mine.count(LATE)]
        return tuple(out)

    def grow(actions: Actions) -> None:
        nonlocal least, best
        if actions in seen:
            return
        seen.add(actions)
        price = cost(actions)
        if least is not None and price > least:
            return
        unhit = next((core for core in cores if all(actions[e] < act for e, act in core)), None)
        if unhit is None:
            best = [actions] if least is None or price < least else [*best, actions]
            least = price
            return
        for e, act in sorted(unhit):
            grow((*actions[:e], act, *actions[e + 1 :]))

    grow((ON_TIME,) * len(ranks))
    return best


def violating(found: PlanResult) -> PlanResult:
    """A plan from which something gave way, with the status of one that violates its mission.

    A visit is asked for with the tube's margin; the formula may hold with less, but that was not asked for.
    """
    plan = {**found.plan, "status": Status.VIOLATED.value}
    data = encoded(plan)
    return replace(found, plan=plan, data=data, hash=_core.plan_hash(data), status=Status.VIOLATED)


def relaxed(court: Court, refusal: InfeasibleError, plan: Callable[[Court], PlanResult]) -> PlanResult:
    """The plan of least violation of a mission that was refused; `plan` is the planner for what is left.

    Raises InfeasibleError when nothing that may give way helps.
    """
    search = Relaxation(court)
    actions = search.mildest(refusal)
    ends, step = search.ends(actions), STEP
    for k in range(FURTHER):
        try:
            found = plan(Court(court.scenario, search.task(actions, ends)))
        except InfeasibleError:
            if k == FURTHER - 1 or not ends:
                raise
            ends = {e: min(end + step, court.task.horizon) for e, end in ends.items()}
            step *= 2
            continue
        gave = tuple(search.gave_way(actions, found))
        return replace(violating(found) if gave else found, relaxed=gave)
    raise refusal
