"""The version of this package, and those of others."""

from functools import cache

__version__ = "0.2.0"


@cache  # reading it takes 1 ms, and a sweep asks for every row
def version_of(distribution: str) -> str:
    from importlib.metadata import PackageNotFoundError, version  # 20 ms that --help can do without

    try:
        return version(distribution)
    except PackageNotFoundError:
        return "unknown"
