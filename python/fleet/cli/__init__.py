"""The `fleet` command."""

from __future__ import annotations

import os
import sys


def main() -> None:
    """Run `fleet` with the arguments of this process; leaves by SystemExit."""
    try:
        from fleet.cli.app import run

        code = run(sys.argv[1:])
        sys.stdout.flush()
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)  # noqa: T201 - nothing that could print better is loaded yet
        code = 130
    except BrokenPipeError:
        # The reader of our output (`| head`) has gone; Python would complain once more when it closes stdout.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 0
    sys.exit(code)
