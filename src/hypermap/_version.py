"""The version of the package: the one that the build wrote, else that of the installed package.

Git's tags give the version (docs/release.md). A wheel contains it as a file. An editable install
may not, so its metadata is asked. A copy that was never installed has no version.
"""

from importlib import import_module

__all__ = ["__version__"]


def _version() -> str:
    try:
        built: str = import_module("hypermap._built_version").__version__
    except ModuleNotFoundError:
        return _installed()
    return built


def _installed() -> str:
    from importlib.metadata import PackageNotFoundError, version  # takes a while to import

    try:
        return version("hypermap")
    except PackageNotFoundError:
        return "0+unknown"


__version__ = _version()
