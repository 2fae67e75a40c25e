"""``python -m cvxlimit`` is ``cvxlimit``."""

from cvxlimit.cli import main

if __name__ == "__main__":
    main()
