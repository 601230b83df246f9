from __future__ import annotations

import pytest

from hypermap.cli.options import check_output
from hypermap.core.errors import HypermapError


def test_an_output_is_checked_before_the_work_begins(tmp_path):
    check_output(tmp_path / "new.hmap", replace=False)
    old = tmp_path / "old.hmap"
    old.touch()
    check_output(old, replace=True)
    for path, replace, reason in [
        (old, False, "exists already; give --force to replace it"),
        (tmp_path, True, "this is a folder"),
        (tmp_path / "nowhere" / "x.hmap", True, "does not exist; create it first"),
    ]:
        with pytest.raises(HypermapError) as error:
            check_output(path, replace)
        assert str(path) in str(error.value)
        assert reason in str(error.value)
