"""The version of the package: the one that the build wrote, else that of the installed package.

Git's tags give the version (docs/release.md). A wheel contains it as a file. An editable install
may not, so its metadata is asked. A copy that was never installed has no version.
"""

__all__ = ["__version__"]


def _installed() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("hypermap")
    except PackageNotFoundError:
        return "0+unknown"


try:
    from hypermap._built_version import __version__
except ModuleNotFoundError:
    __version__ = _installed()
