"""The command ``cvxlimit``, which is ``python -m cvxlimit`` as well.

Nothing heavy is imported here before Ctrl-C is taken care of.
"""

import os
import signal
import sys
from types import FrameType
from typing import NoReturn

INTERRUPTED = 130
"""128 plus the number of the signal, as shells have it."""


def main() -> NoReturn:
    if sys.flags.optimize > 1:
        sys.exit("cvxlimit: python -OO leaves out docstrings, which options are read from: use -O")
    is_ours = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if is_ours:
        signal.signal(signal.SIGINT, _stop)
    from cvxlimit.cli.main import main as run

    def raise_again() -> None:
        if is_ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)

    try:
        run(raise_again)
    except KeyboardInterrupt:
        _stop()


def _stop(number: int = signal.SIGINT, frame: FrameType | None = None) -> NoReturn:
    """End at once: an exception would get lost in imports that try one library after another."""
    with open(2, "w", closefd=False) as errors:
        errors.write("cvxlimit: interrupted\n")
    os._exit(INTERRUPTED)


if __name__ == "__main__":
    main()
