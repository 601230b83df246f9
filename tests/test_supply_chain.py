"""What comes along when Hypermap is installed: pinned by hashes, listed, under licenses allowed."""

from __future__ import annotations

import importlib
import json
import re
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
LOCKS = sorted((ROOT / "requirements").glob("*.txt"))
LOCKS.remove(ROOT / "requirements" / "licenses.txt")
HYPERMAP = ROOT / "requirements" / "hypermap.txt"


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a function that imports one of the scripts."""
    monkeypatch.syspath_prepend(ROOT / "scripts")
    return lambda name: importlib.import_module(name)


def licenses(*arguments: Path, known: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run the check of the licenses, with one more folder of installed packages."""
    command = [sys.executable, str(ROOT / "scripts" / "licenses.py"), *map(str, arguments)]
    return subprocess.run(
        command, env={"PYTHONPATH": str(known or "")}, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize("lock", LOCKS, ids=lambda lock: lock.name)
def test_every_requirement_is_pinned_by_hashes_and_no_index_is_named(
    lock: Path, script: Any
) -> None:
    pins = script("locked").read_pins(lock)
    assert pins
    for pin in pins:
        assert pin.hashes, pin.name
        assert all(re.fullmatch("[0-9a-f]{64}", content) for content in pin.hashes), pin.name
    assert "://" not in lock.read_text()
    assert "index" not in lock.read_text()


@pytest.mark.parametrize("lock", LOCKS, ids=lambda lock: lock.name)
def test_the_extras_that_packages_want_of_each_other_are_pinned(lock: Path, script: Any) -> None:
    # Otherwise pip 23 takes the newest release for them, and refuses it, as it has no hash.
    pins = script("locked").read_pins(lock)
    pinned: dict[str, set[str]] = {}
    for pin in pins:
        pinned.setdefault(pin.name, set()).update(pin.extras)
    for pin in pins:
        try:
            needed = metadata.distribution(pin.name).requires or []
        except metadata.PackageNotFoundError:
            continue  # not for this computer, or not among what tests need
        for requirement in map(Requirement, needed):
            marker = requirement.marker
            if marker is None or any(marker.evaluate({"extra": e}) for e in {"", *pin.extras}):
                wanted = pinned.get(canonicalize_name(requirement.name), set())
                assert requirement.extras <= wanted, f"{pin.name} needs {requirement}"


def test_pip_refuses_a_file_that_is_not_the_one_that_was_pinned(tmp_path: Path) -> None:
    file = tmp_path / "falsified-1.0-py3-none-any.whl"
    file.write_bytes(b"not what was pinned")
    lock = tmp_path / "requirements.txt"
    lock.write_text(f"falsified==1.0 --hash=sha256:{'0' * 64}\n")
    install = (ROOT / "scripts" / "venv.sh").read_text()
    assert "pip install --quiet --disable-pip-version-check --require-hashes -r" in install
    command = [sys.executable, "-m", "pip", "install", "--isolated", "--no-index", "--dry-run"]
    done = subprocess.run(
        [*command, "--require-hashes", "--find-links", str(tmp_path), "-r", str(lock)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode != 0
    assert "DO NOT MATCH THE HASHES" in done.stderr


def test_the_licenses_of_all_that_an_install_brings_are_listed_and_allowed() -> None:
    done = licenses()
    assert (done.stdout, done.stderr, done.returncode) == ("", "", 0)


@pytest.mark.parametrize(
    ("listed", "metadata", "said"),
    [
        ("MIT", "License-Expression: MIT", None),
        ("MIT", "Classifier: License :: OSI Approved :: MIT License", None),
        ("BSD-3-Clause", "Classifier: License :: OSI Approved :: BSD License", None),
        ("MIT", "License: MIT", None),
        ("MIT OR GPL-3.0-only", "License-Expression: MIT OR GPL-3.0-only", None),
        (
            "MIT AND (ISC OR AGPL-3.0-only)",
            "License-Expression: MIT AND (ISC OR AGPL-3.0-only)",
            None,
        ),
        ("", "License-Expression: MIT", "a-package: does not stand in licenses.txt"),
        (
            "GPL-3.0-only",
            "License-Expression: GPL-3.0-only",
            "GPL-3.0-only is not among",
        ),
        ("MIT AND GPL-3.0-only", "License: MIT", "MIT AND GPL-3.0-only is not among"),
        ("MIT", "License-Expression: GPL-3.0-only", "says MIT, and the package GPL-3.0-only"),
        ("MIT", "License-Expression: MIT AND GPL-3.0-only", "and the package MIT AND GPL-3.0-only"),
        ("MIT", "License: Proprietary", "and the package Proprietary"),
        ("MIT", "Summary: says nothing", "and the package nothing"),
        (
            "MIT",
            "Classifier: License :: OSI Approved :: GNU General Public License v3 (GPLv3)",
            "and the package GNU General Public License v3 (GPLv3)",
        ),
    ],
)
def test_a_package_that_comes_in_needs_a_license_that_is_allowed(
    tmp_path: Path, listed: str, metadata: str, said: str | None
) -> None:
    (tmp_path / "requirements.txt").write_text(f"a-package==1.0 --hash=sha256:{'0' * 64}\n")
    (tmp_path / "licenses.txt").write_text(f"a-package {listed}\n" if listed else "# none\n")
    folder = tmp_path / "site" / "a_package-1.0.dist-info"
    folder.mkdir(parents=True)
    (folder / "METADATA").write_text(
        f"Metadata-Version: 2.4\nName: a-package\nVersion: 1.0\n{metadata}\n"
    )
    done = licenses(
        tmp_path / "requirements.txt", tmp_path / "licenses.txt", known=tmp_path / "site"
    )
    assert done.stderr == ""
    assert done.returncode == (0 if said is None else 1)
    assert (said or "") in done.stdout
    assert bool(done.stdout) == (said is not None)


@pytest.mark.xdist_group("json_schema")  # they share what takes long to import
def test_the_bill_of_materials_lists_what_is_locked(tmp_path: Path, script: Any) -> None:
    from cyclonedx.schema import SchemaVersion
    from cyclonedx.validation.json import JsonStrictValidator  # takes seconds to import

    files = tmp_path / "one.json", tmp_path / "another.json"
    for file in files:
        command = [sys.executable, "-W", "error", str(ROOT / "scripts" / "sbom.py"), str(HYPERMAP)]
        subprocess.run([*command, str(file)], check=True)
    text = files[0].read_text()
    assert text == files[1].read_text()
    assert JsonStrictValidator(SchemaVersion.V1_6).validate_str(text) is None

    bill = json.loads(text)
    version = importlib.import_module("hypermap").__version__
    assert bill["metadata"]["component"]["version"] == version
    locked = {
        (pin.name, pin.version): set(pin.hashes) for pin in script("locked").read_pins(HYPERMAP)
    }
    listed = {(part["name"], part["version"]): part for part in bill["components"]}
    assert listed.keys() == locked.keys()
    for key, part in listed.items():
        (files_of_it,) = part["externalReferences"]
        assert {content["content"] for content in files_of_it["hashes"]} == locked[key]
        assert part["licenses"], key
    (needs,) = [entry for entry in bill["dependencies"] if "hypermap@" in entry["ref"]]
    assert len(needs["dependsOn"]) == len(locked)


def package(name: str, **more: Any) -> dict[str, Any]:
    return {"name": name, "version": "1.0", "vulns": [], **more}


HOLE = {"id": "CVE-2026-1", "fix_versions": ["1.1", "2.0"], "aliases": [], "description": "bad"}
SKIPPED = {"name": "numpy", "skip_reason": "Dependency not found on PyPI"}


@pytest.mark.parametrize(
    ("packages", "said", "code"),
    [
        (None, "lock: not audited, as no data on vulnerabilities can be reached here", 2),
        ([SKIPPED], "lock: not audited, as no data on vulnerabilities can be reached here", 2),
        ([package("rich")], "lock: no known vulnerabilities in 1 packages", 0),
        (
            [package("rich"), SKIPPED],
            "lock: no known vulnerabilities in 1 packages; not looked up: numpy",
            2,
        ),
        (
            [package("rich", vulns=[HOLE]), SKIPPED],
            "lock: 1 known vulnerabilities\nrich 1.0: CVE-2026-1, mended in 1.1, 2.0",
            1,
        ),
        (
            [package("rich", vulns=[{**HOLE, "fix_versions": []}])],
            "lock: 1 known vulnerabilities\nrich 1.0: CVE-2026-1, mended in no version yet",
            1,
        ),
    ],
)
def test_an_audit_says_what_it_found_and_never_that_all_is_well_where_it_saw_nothing(
    script: Any, packages: list[dict[str, Any]] | None, said: str, code: int
) -> None:
    audit: ModuleType = script("audit")
    report = None if packages is None else {"dependencies": packages, "fixes": []}
    assert audit.judge("lock", report) == (said, code)
