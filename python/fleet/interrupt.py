"""Ctrl-C (and SIGTERM, SIGHUP) in a command that owns processes and drones.

While ``raising``, the first signal raises KeyboardInterrupt where the program stands. From then on, and
whenever raising is off, signals are only counted, so that nothing can break into the cleaning up.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_AGAIN_S = 0.02


@contextmanager
def deliver_again(forget: Callable[[], None] = lambda: None) -> Iterator[None]:
    """Repeat a Ctrl-C whose KeyboardInterrupt rose where Python drops exceptions.

    The import system runs callbacks of weak references, in which an exception is printed and lost. ``forget``
    takes the lost signal back before it comes again.
    """
    before = sys.unraisablehook

    def hook(lost: sys.UnraisableHookArgs) -> None:
        if lost.exc_type is not KeyboardInterrupt:
            before(lost)
            return
        forget()
        # Raised here it would be lost again: this hook is such a place too.
        timer = threading.Timer(_AGAIN_S, signal.raise_signal, [signal.SIGINT])
        timer.daemon = True
        timer.start()

    sys.unraisablehook = hook
    try:
        yield
    finally:
        sys.unraisablehook = before


@contextmanager
def unswallowed() -> Iterator[None]:
    """Raise a KeyboardInterrupt at the end of the block that foreign code inside has caught.

    CasADi asks Python for signals during a solve, and then reports the exception of the handler as one of
    several failures of the solver, from which it cannot be told apart.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    raised = False

    def noting(handler: Callable[[int, FrameType | None], Any]) -> Callable[[int, FrameType | None], None]:
        def on_signal(number: int, frame: FrameType | None) -> None:
            nonlocal raised
            try:
                handler(number, frame)
            except KeyboardInterrupt:
                raised = True
                raise

        return on_signal

    before = {one: handler for one in _SIGNALS if callable(handler := signal.getsignal(one))}
    for one, handler in before.items():
        signal.signal(one, noting(handler))
    try:
        yield
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)
    if raised:
        raise KeyboardInterrupt


class Interrupt:
    """Counts the signals of one command."""

    def __init__(self) -> None:
        """No signal yet; raising is on."""
        self.count = 0
        self.raising = True
        self._pending = False
        self._shields = 0

    @property
    def asked(self) -> bool:
        """Whether any signal has come."""
        return self.count > 0

    @contextmanager
    def installed(self) -> Iterator[None]:
        """Handle the signals inside the block; a thread other than the main one cannot and leaves them."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        # A signal that our parent has switched off stays off: `nohup fleet fly ...` outlives its terminal.
        wanted = [one for one in _SIGNALS if signal.getsignal(one) is not signal.SIG_IGN]
        before = [signal.signal(one, self._on_signal) for one in wanted]
        try:
            with deliver_again(self._forget_one):
                yield
        finally:
            for one, handler in zip(wanted, before, strict=True):
                signal.signal(one, handler)

    @contextmanager
    def shielded(self) -> Iterator[None]:
        """Hold a KeyboardInterrupt back to the end of the block, which must be short."""
        self._shields += 1
        try:
            yield
        finally:
            self._shields -= 1
            if self._pending and not self._shields:
                self._pending = False
                self._raise()

    def count_only(self) -> None:
        """From here on signals are only counted."""
        self.raising = False

    def _on_signal(self, _number: int, _frame: FrameType | None) -> None:
        self.count += 1
        if self._shields:
            self._pending = True
        else:
            self._raise()

    def _forget_one(self) -> None:
        self.count -= 1
        self.raising = True

    def _raise(self) -> None:
        if self.raising:
            self.raising = False
            raise KeyboardInterrupt
