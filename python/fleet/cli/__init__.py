"""The `fleet` command."""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType


def main() -> None:
    """Run `fleet` with the arguments of this process; leaves by SystemExit."""
    # Until the program is loaded there is nothing to clean up, and an exception might be lost in an import.
    # A signal that our parent has switched off stays off.
    usual = signal.getsignal(signal.SIGINT)
    if usual is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, _leave)
    # Our matrices are small: a second thread of numpy's BLAS only waits for the first.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        from fleet.cli.app import run
        from fleet.interrupt import deliver_again

        if usual is not signal.SIG_IGN:
            signal.signal(signal.SIGINT, _unless_answered)
        with deliver_again():
            code = run(sys.argv[1:])
        sys.stdout.flush()
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)  # noqa: T201 - nothing that could print better is loaded yet
        code = 130
    except BrokenPipeError:
        # The reader of our output (`| head`) has gone; Python would complain once more when it closes stdout.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 0
    # What is left is the interpreter's own end, which a signal would make look like a failure.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # CPython ends by SIGINT, whatever our code is, once a KeyboardInterrupt has passed an `exec` (imports of
    # data classes have some), until another `exec` ends well (run_eval_code_obj in pythonrun.c).
    exec("")
    sys.exit(code)


def _unless_answered(number: int, frame: FrameType | None) -> None:
    """Python's own Ctrl-C, until a command has answered: nothing is left to be interrupted then."""
    from fleet.cli.reply import SETTINGS

    if SETTINGS.answered is None:
        signal.default_int_handler(number, frame)


def _leave(_number: int, _frame: FrameType | None) -> None:
    os.write(2, b"interrupted\n")
    os._exit(130)
