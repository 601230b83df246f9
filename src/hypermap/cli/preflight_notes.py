"""Warnings of the pre-flight check, printed at once and again at the end."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hypermap.cli.terminal import note

if TYPE_CHECKING:
    from hypermap.mapping.preflight import Finding


class PreflightNotes:
    """Prints each problem when it is found, and all remedies at the end."""

    def __init__(self) -> None:
        self._found: list[Finding] = []

    def add(self, finding: Finding) -> None:
        """Print a problem."""
        self._found.append(finding)
        note(f"warning: {finding}")

    def remind(self) -> None:
        """Print the remedies again, if there were problems."""
        if self._found:
            note("\nwarning: problems in the recording make the map worse; map it again with:")
            for finding in self._found:
                note(f"  {finding.check}: {finding.remedy}")
