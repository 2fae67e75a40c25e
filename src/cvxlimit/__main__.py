"""``python -m cvxlimit`` is ``cvxlimit``."""

from cvxlimit.cli.main import main

if __name__ == "__main__":
    main()
