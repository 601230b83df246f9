"""Checks the licenses of all that comes along: licenses.py [REQUIREMENTS [LICENSES]].

Every package that an install without extras can bring stands in requirements/licenses.txt with its
license, which must be one that goes with BSD-3-Clause; where it is installed, what it
says of itself must fit. Prints what is not so, and ends with 1.
"""

from __future__ import annotations

import re
import sys
from importlib import metadata
from pathlib import Path

from locked import ROOT, read_licenses, read_pins

# What lets others use, change and sell a program that uses it, under whatever license that has.
ALLOWED = {
    "0BSD",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "CC-BY-4.0",  # of tables of colors, which are no program
    "CC0-1.0",
    "ISC",
    "MIT",
    "MIT-CMU",
    "PSF-2.0",
    "Zlib",
}

# What packages said before there was a field for SPDX expressions.
_CLASSIFIERS = {
    "Apache Software License": {"Apache-2.0"},
    "BSD License": {"BSD-2-Clause", "BSD-3-Clause"},
    "ISC License (ISCL)": {"ISC"},
    "MIT License": {"MIT"},
    "Python Software Foundation License": {"PSF-2.0"},
}
_WORDS = {
    "3-Clause BSD License": {"BSD-3-Clause"},
    "any-OSI": {"MIT"},  # apsw: any that the Open Source Initiative approves
}


def is_allowed(expression: str) -> bool:
    """Return whether an SPDX expression demands no license that we do not want."""
    parts = expression.replace("(", "").replace(")", "").split(" AND ")
    return all(any(choice in ALLOWED for choice in part.split(" OR ")) for part in parts)


def said_by(package: metadata.PackageMetadata) -> set[str]:
    """Return the SPDX expressions that fit what a package says of itself."""
    if expression := package.get("License-Expression"):
        return {expression}
    heads = "License :: OSI Approved :: "
    classifiers = [
        text.removeprefix(heads)
        for text in package.get_all("Classifier") or []
        if text.startswith(heads)
    ]
    if classifiers:
        return set().union(*(_CLASSIFIERS.get(text, {text}) for text in classifiers))
    text = (package.get("License") or "").partition("\n")[0]
    return _WORDS.get(text, {text})


def find_problems(requirements: Path, licenses: Path) -> list[str]:
    """Return in words what is not as it should be with the licenses of pinned packages."""
    listed = read_licenses(licenses)
    names = sorted({pin.name for pin in read_pins(requirements)})
    spare = listed.keys() - set(names)
    problems = [f"{name}: stands in {licenses.name}, and is not pinned" for name in spare]
    for name in names:
        if name not in listed:
            problems.append(f"{name}: does not stand in {licenses.name}")
        elif not is_allowed(listed[name]):
            problems.append(f"{name}: {listed[name]} is not among the licenses allowed")
        elif said := _otherwise(name, listed[name]):
            problems.append(f"{name}: {licenses.name} says {listed[name]}, and the package {said}")
    return sorted(problems)


def _otherwise(name: str, listed: str) -> str:
    """Return what the package says, if that is not allowed or has nothing of what the list says."""
    try:
        said = said_by(metadata.metadata(name))
    except metadata.PackageNotFoundError:  # for other computers
        return ""
    # Versions for other Pythons may name more of what they hold.
    fits = any(is_allowed(text) and _names(text) & _names(listed) for text in said)
    return "" if fits else " or ".join(sorted(said)) or "nothing"


def _names(expression: str) -> set[str]:
    return set(re.split(r" AND | OR |[()]", expression))


def main() -> int:
    """Check the licenses, and return the exit code."""
    given = [Path(argument) for argument in sys.argv[1:]]
    usual = [ROOT / "requirements" / "hypermap.txt", ROOT / "requirements" / "licenses.txt"]
    problems = find_problems(*given, *usual[len(given) :])
    sys.stdout.write("".join(f"{problem}\n" for problem in problems))
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
