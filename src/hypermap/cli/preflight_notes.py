"""What the pre-flight check finds, told at once and again at the end."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hypermap.cli.terminal import note

if TYPE_CHECKING:
    from hypermap.mapping.preflight import Finding


class PreflightNotes:
    """Tells each fault when it is found, and at the end what to do about all of them."""

    def __init__(self) -> None:
        self._found: list[Finding] = []

    def add(self, finding: Finding) -> None:
        """Tell a fault."""
        self._found.append(finding)
        note(f"warning: {finding}")

    def remind(self) -> None:
        """Say again what mends the faults, if there are any."""
        if self._found:
            note("\nwarning: the map suffers from its recording; map it again:")
            for finding in self._found:
                note(f"  {finding.check}: {finding.remedy}")
