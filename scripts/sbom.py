"""Writes what an install can bring, as CycloneDX JSON: sbom.py REQUIREMENTS OUTPUT.

Each pinned package with its version, license and the hashes of its files; those for some computers
or Pythons alone say for which. The same requirements give the same bytes.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from uuid import UUID, uuid5

from cyclonedx.contrib.license.factories import LicenseFactory
from cyclonedx.model import (
    ExternalReference,
    ExternalReferenceType,
    HashAlgorithm,
    HashType,
    Property,
    XsUri,
)
from cyclonedx.model.bom import Bom
from cyclonedx.model.component import Component, ComponentType
from cyclonedx.output.json import JsonV1Dot6
from locked import ROOT, Pin, read_licenses, read_pins
from packageurl import PackageURL

from hypermap import __version__

_NAMESPACE = UUID("6d5c0b3e-7a55-4cc5-9d0e-1a4c5a0f3c52")


def make_bom(requirements: Path) -> Bom:
    """Return the bill of materials of pinned requirements."""
    bom = Bom(serial_number=uuid5(_NAMESPACE, requirements.read_text()))
    bom.metadata.component = _component("hypermap", __version__, "BSD-3-Clause")
    bom.metadata.component.type = ComponentType.APPLICATION
    licenses = read_licenses(ROOT / "requirements" / "licenses.txt")
    pins = [_pinned(pin, licenses.get(pin.name)) for pin in read_pins(requirements)]
    bom.components.update(pins)
    bom.register_dependency(bom.metadata.component, pins)
    return bom


def _pinned(pin: Pin, expression: str | None) -> Component:
    component = _component(pin.name, pin.version, expression)
    hashes = [HashType(alg=HashAlgorithm.SHA_256, content=content) for content in pin.hashes]
    component.external_references.add(
        ExternalReference(
            type=ExternalReferenceType.DISTRIBUTION,
            url=XsUri(f"pkg:pypi/{pin.name}@{pin.version}"),
            comment="hashes of its files, one of which is installed",
            hashes=hashes,
        )
    )
    if pin.marker:
        component.properties.add(Property(name="hypermap:marker", value=pin.marker))
    return component


def _component(name: str, version: str, expression: str | None) -> Component:
    url = PackageURL("pypi", name=name, version=version)
    return Component(
        name=name,
        version=version,
        type=ComponentType.LIBRARY,
        purl=url,
        bom_ref=str(url),
        licenses=[LicenseFactory().make_from_string(expression)] if expression else (),
    )


def main() -> None:
    """Write the bill of materials."""
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    document = json.loads(JsonV1Dot6(make_bom(Path(sys.argv[1]))).output_as_string())
    del document["metadata"]["timestamp"]  # of this moment: the same requirements, the same bytes
    Path(sys.argv[2]).write_text(json.dumps(document, indent=1, sort_keys=True) + "\n")


if __name__ == "__main__":
    main()
