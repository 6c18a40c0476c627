"""A Ctrl-C that Python would drop comes again."""

import signal
import time
import weakref

import pytest

from fleet.interrupt import Interrupt


class Thing:
    """Something to refer to weakly."""


def test_an_interrupt_lost_in_a_callback_comes_again() -> None:
    interrupt = Interrupt()
    thing = Thing()

    def die(_: object) -> None:
        signal.raise_signal(signal.SIGINT)

    reference = weakref.ref(thing, die)
    with interrupt.installed(), pytest.raises(KeyboardInterrupt):
        del thing
        for _ in range(200):
            time.sleep(0.01)
    assert reference() is None
    assert interrupt.count == 1


def test_an_interrupt_comes_once() -> None:
    interrupt = Interrupt()
    with interrupt.installed():
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
    assert interrupt.count == 2
