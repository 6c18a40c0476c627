"""IPOPT tells its progress after every iteration, and stops when that raises."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import casadi as ca

from fleet.interrupt import unswallowed


class Listener(ca.Callback):
    """The iteration callback of a solver with `sizes` unknowns, constraints and parameters."""

    def __init__(self, name: str, sizes: tuple[int, int, int]) -> None:
        """Say nothing until `listening`."""
        super().__init__()
        unknowns, constraints, parameters = sizes
        self.rows = {"x": unknowns, "f": 1, "g": constraints}
        self.rows |= {"lam_x": unknowns, "lam_g": constraints, "lam_p": parameters}
        self.tell: Callable[[Any], None] | None = None
        self.raised: BaseException | None = None
        self.construct(name, {})

    @contextmanager
    def listening(self, tell: Callable[[Any], None] | None) -> Iterator[None]:
        """Call `tell` with the unknowns after every iteration; what it raises ends the solve, and this block.

        CasADi reports every exception of a callback as one and the same failure.
        """
        self.tell, self.raised = tell, None
        try:
            with unswallowed():
                yield
        finally:
            self.tell = None
        if self.raised is not None:
            raise self.raised

    def eval(self, arg: Sequence[Any]) -> list[Any]:
        """One iteration is done; 1 stops the solver."""
        try:
            if self.tell is not None:
                self.tell(arg[0])
        except BaseException as error:  # noqa: BLE001 - raised again at the end of `listening`
            self.raised = error
            return [1]
        return [0]

    def get_n_in(self) -> int:
        """As many as the solver has results."""
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        """Whether to stop."""
        return 1

    def get_name_in(self, index: int) -> str:
        """Named as the solver's results."""
        return str(ca.nlpsol_out(index))

    def get_sparsity_in(self, index: int) -> Any:
        """Columns."""
        return ca.Sparsity.dense(self.rows[ca.nlpsol_out(index)])
