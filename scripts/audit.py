"""Says which pinned packages have known vulnerabilities: audit.py REQUIREMENTS...

Asks pip-audit, which asks the package index; what this computer and Python would install is looked
up. Ends with 1 if there is something to mend, with 2 if nothing or not all could be looked up.
"""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any


def ask(requirements: str) -> dict[str, Any] | None:
    """Return pip-audit's report, or None if it has none."""
    command = [sys.executable, "-m", "pip_audit", "--format=json", "--progress-spinner=off"]
    done = subprocess.run(
        [*command, "--require-hashes", "--disable-pip", "--requirement", requirements],
        capture_output=True,
        text=True,
    )
    try:
        report: dict[str, Any] = json.loads(done.stdout)
    except json.JSONDecodeError:  # it ends with a traceback where it reaches nothing
        return None
    return report


def judge(requirements: str, report: dict[str, Any] | None) -> tuple[str, int]:
    """Return what is to be said of a report, and the exit code."""
    packages = [] if report is None else report["dependencies"]
    skipped = [package["name"] for package in packages if "skip_reason" in package]
    looked_up = len(packages) - len(skipped)
    found = [
        f"{package['name']} {package['version']}: {hole['id']}, mended in "
        f"{', '.join(hole['fix_versions']) or 'no version yet'}"
        for package in packages
        for hole in package.get("vulns", ())
    ]
    if found:
        return "\n".join([f"{requirements}: {len(found)} known vulnerabilities", *found]), 1
    if not looked_up:
        return (
            f"{requirements}: not audited, as no data on vulnerabilities can be reached here",
            2,
        )
    said = f"{requirements}: no known vulnerabilities in {looked_up} packages"
    if skipped:
        return f"{said}; not looked up: {', '.join(skipped)}", 2
    return said, 0


def main() -> int:
    """Audit each file, and return the worst exit code."""
    codes = [0]
    for requirements in sys.argv[1:]:
        said, code = judge(requirements, ask(requirements))
        sys.stdout.write(said + "\n")
        codes.append(code)
    return 1 if 1 in codes else max(codes)


if __name__ == "__main__":
    sys.exit(main())
