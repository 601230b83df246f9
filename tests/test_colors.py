from __future__ import annotations

import itertools
import math
import subprocess
import sys

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hypermap.colors import class_colors

ROOM = ["chair", "table", "cup", "tvmonitor", "keyboard", "sink", "person", "cupboard", "bin"]


@settings(deadline=None)  # the first call loads the palette
@given(st.sets(st.text(max_size=8), max_size=60))
def test_no_two_classes_of_a_map_look_alike(names):
    colors = class_colors(names)
    assert set(colors) == names
    assert len(set(colors.values())) == len(names)


@settings(deadline=None)  # the first call loads the palette
@given(st.permutations(["zebra", *ROOM, "noteboard", "Weinglas"]))
def test_colors_do_not_depend_on_the_order_of_the_objects(names):
    assert class_colors(names) == class_colors(sorted(names))


def test_a_common_class_has_the_same_color_whatever_else_is_in_the_map():
    alone = {name: class_colors([name])[name] for name in ROOM}
    together = class_colors([*ROOM, *(f"thing {i}" for i in range(100))])
    assert {name: together[name] for name in ROOM} == alone


@pytest.mark.parametrize(
    ("one", "other"), [("potted plant", "pottedplant"), ("Cell_Phone", "cell phone")]
)
def test_spellings_of_one_class_have_one_color(one, other):
    assert class_colors([one])[one] == class_colors([other])[other]


def test_the_classes_of_a_room_are_easy_to_tell_apart_and_visible_on_white_and_black():
    colors = list(class_colors(ROOM).values())
    for one, other in itertools.combinations([*colors, (1, 1, 1), (0, 0, 0)], 2):
        assert math.dist(one, other) > 0.3


def test_the_palette_is_that_of_colorcet_without_importing_it() -> None:
    code = (
        "import sys; from hypermap.colors import _palette; colors = _palette(); "
        "assert not {'colorcet', 'matplotlib'} & set(sys.modules); "
        "import colorcet; names = colorcet.b_glasbey_bw_minc_20_maxl_70; "
        "assert ['#' + bytes(round(255 * c) for c in color).hex() for color in colors] == names"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
