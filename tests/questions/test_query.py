"""Queries as values: what they refuse, and that JSON keeps them."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta, timezone
from typing import Any, get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.errors import FormatError
from hypermap.questions import QUERY_SCHEMA, Condition, Number, Query, Reference
from hypermap.questions.query import Give, Measure, Measured, Relation, When, Which

OF_NUMBERS = ("highest", "lowest", "most", "fewest")
NAMES = st.lists(st.text(min_size=1, max_size=8), min_size=1, max_size=3).map(tuple)
METERS = st.floats(0, 100)
PLACES = (
    st.builds(Reference, rooms=NAMES)
    | st.builds(Reference, point_xy=st.tuples(METERS, METERS))
    | st.just(Reference(is_asker=True))
    | st.just(Reference(area="POLYGON ((0 0, 2 0, 2 1, 0 0))"))
)


MOMENTS = st.datetimes(
    datetime(1970, 1, 1), datetime(2100, 1, 1), timezones=st.just(timezone(timedelta(hours=5.5)))
)
WHEN = (
    st.builds(When, st.sampled_from(["seen", "new"]), MOMENTS, st.none() | MOMENTS)
    | st.builds(When, st.sampled_from(["seen", "new"]), st.none(), MOMENTS)
    | st.builds(When, st.just("not seen"), MOMENTS)
)


def conditions(references: st.SearchStrategy[Reference]) -> st.SearchStrategy[Condition]:
    plain = [one for one in get_args(Relation) if one not in ("near", "beyond", "between")]
    return (
        st.builds(Condition, st.sampled_from(plain), references, negated=st.booleans())
        | st.builds(Condition, st.sampled_from(["near", "beyond"]), references, METERS)
        | st.builds(Condition, st.just("between"), references, other=references)
    )


REFERENCES = PLACES | st.builds(
    Reference, names=NAMES, where=st.lists(conditions(PLACES), max_size=2).map(tuple)
)
QUERIES = st.builds(
    Query,
    st.sampled_from([give for give in get_args(Give) if give not in ("places", "value")]),
    names=NAMES | st.just(()),
    besides=NAMES | st.just(()),
    where=st.lists(conditions(REFERENCES), max_size=2).map(tuple),
    exact=st.booleans(),
    ids=st.lists(st.integers(0, 9), max_size=2).map(tuple),
    tags=NAMES | st.just(()),
    when=st.lists(WHEN, max_size=2).map(tuple),
    as_of=st.none() | MOMENTS,
    measured=st.none() | st.builds(Measured, st.none() | st.just("warmth"), METERS, METERS),
    layers=NAMES | st.just(()),
    which=st.none() | st.sampled_from([w for w in get_args(Which) if w not in OF_NUMBERS]),
    count=st.none() | st.integers(1, 9),
    start=st.none() | REFERENCES,
    by=st.sampled_from(get_args(Measure)),
)


NUMBERS = st.builds(Number, st.integers(1, 9), st.none() | st.integers(9, 12))
COUNTS = st.builds(
    Query,
    st.sampled_from(["count", "exists", "rooms"]),
    names=NAMES,
    per=st.just("room"),
    number=NUMBERS,
) | st.builds(
    Query,
    st.just("rooms"),
    which=st.sampled_from(["most", "fewest"]),
    count=st.none() | st.integers(1, 9),
    per=st.just("room"),
)
RANKED = st.builds(
    Query, names=NAMES, which=st.sampled_from(["nearest", "tallest"]), rank=st.integers(1, 9)
)


@pytest.mark.xdist_group("json_schema")  # whose library takes a second to import
@given(QUERIES | COUNTS | RANKED)
def test_json_keeps_a_query_and_follows_the_schema(json_validator: Any, query: Query) -> None:
    values = query.to_json()
    json_validator(QUERY_SCHEMA).validate(values)
    assert Query.from_json(values) == query


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([], "the query: expected an object, got list"),
        ({"name": ["cup"]}, "there is no key 'name'; known: give, names"),
        ({"names": "cup"}, "names: expected a list, got str"),
        ({"names": [1]}, "names: expected names"),
        ({"give": "all"}, "'all' is not one of objects, count"),
        ({"when": {}}, "when: a time needs its begin or its end"),
        ({"when": {"since": "monday"}}, "when.since: 'monday' is not a date or time"),
        ({"when": {"since": 5, "seen": "once"}}, "when.since: '5' is not a date or time"),
        ({"when": {"until": "2026-11-20", "seen": "not seen"}}, "needs the time since when"),
        ({"when": {"since": "2026-11-20", "for": 3}}, "when: there is no key 'for'"),
        ({"rooms": ["kitchen"], "when": {"since": "2026-11-20"}}, "for rooms or for objects"),
        ({"count": 0}, "count must be at least 1"),
        ({"count": 1.5}, "count: expected a whole number"),
        ({"which": "nearest", "rank": 0}, "rank must be at least 1"),
        ({"rank": 2}, "a rank is of the nearest, the largest and so on"),
        ({"which": "nearest", "rank": 2, "count": 2}, "without a count"),
        ({"give": "labels", "which": "nearest", "rank": 2}, "a rank is of objects or rooms"),
        ({"where": [{"relation": "in"}]}, r"where\[0\]: the key 'what' is missing"),
        ({"where": [{"relation": "upon", "what": {"names": ["a"]}}]}, "no relation 'upon'"),
        ({"where": [{"relation": "in", "what": {}}]}, r"where\[0\].what: a reference is exactly"),
        ({"where": [{"relation": "at", "what": {"point": [1, "a"]}}]}, "two finite numbers"),
        ({"where": [{"relation": "beyond", "what": {"asker": True}}]}, "'beyond' needs a distance"),
        ({"where": [{"relation": "at", "what": {"point": [1, int("1" * 400)]}}]}, "two finite"),
        ({"start": {"point": [1e300, 2]}}, "start: a point is farther away than 1e"),
        ({"measured": {"above": int("1" * 400)}}, "measured.above: expected a number"),
        (
            {"where": [{"relation": "near", "what": {"asker": True}, "within": 1e10}]},
            r"where\[0\]: a distance is farther away than 1e",
        ),
        (
            {"where": [{"relation": "near", "what": {"asker": True}, "within": int("1" * 400)}]},
            r"where\[0\].within: expected a number",
        ),
        ({"start": {"names": ["a"], "rooms": ["b"]}}, "start: a reference is exactly one of"),
        ({"when": [{}]}, r"when\[0\]: a time needs its begin or its end"),
        ({"when": "monday"}, "when: expected a list, got str"),
        ({"as_of": "monday"}, "as_of: 'monday' is not a date or time"),
        ({"ids": ["7"]}, "ids: expected a whole number"),
        ({"tags": "red"}, "tags: expected a list"),
        ({"exact": 1}, "exact: expected true or false"),
        ({"exact": None}, "exact: expected true or false"),
        ({"like": 5}, "like: expected a text"),
        ({"value": "5"}, "value: expected a number"),
        ({"measured": {"above": "hot"}}, "measured.above: expected a number"),
        ({"give": "places"}, "'places' needs measured values with a limit"),
        ({"give": "value"}, "values, the highest and the lowest need measured values"),
        ({"value": 3}, "only 'labels' has the values of cells"),
        ({"start": {"area": "POLYGON((0 0"}}, "start: this is not WKT"),
        (
            {"start": {"area": "GEOMETRYCOLLECTION(" * 200_000}},
            "start: a collection in a collection is not read",
        ),
        ({"start": {"area": "POINT(0 0)"}}, "start: the area is empty"),
        ({"names": ["a"], "rooms": ["b"]}, "for rooms or for objects, not for both"),
        ({"per": "floor"}, "'floor' is not one of room"),
        ({"per": "room"}, "'per' goes with 'count', 'exists' and 'rooms'"),
        ({"give": "exists", "per": "room"}, "with how many"),
        ({"give": "rooms", "per": "room", "which": "largest"}, "'which' is 'most' or 'fewest'"),
        ({"give": "rooms", "which": "most"}, "the most and the fewest need 'per'"),
        ({"number": {"at_least": 2}}, "a number is for 'exists', or goes with 'per'"),
        ({"number": {"at_least": -1}}, "number: a number is at least 0"),
        ({"number": {"at_least": 2.0}}, "number.at_least: expected a whole number"),
        ({"number": {}}, "number: a number needs 'at_least' or 'at_most'"),
        ({"where": [{"relation": "between", "what": {"asker": True}}]}, "needs a second reference"),
    ],
)
def test_what_is_no_query_is_refused_by_the_name_of_its_key(values: Any, message: str) -> None:
    with pytest.raises(FormatError, match=message):
        Query.from_json(values)


def test_references_within_each_other_have_an_end() -> None:
    reference: dict[str, Any] = {"names": ["cup"]}
    for _ in range(1000):
        reference = {"names": ["cup"], "where": [{"relation": "near", "what": reference}]}
    with pytest.raises(FormatError, match="more than 8 nested references"):
        Query.from_json({"where": [{"relation": "near", "what": reference}]})


@pytest.mark.parametrize("value", [False, 0, [], {}, True, 3])
def test_what_is_no_text_is_refused_where_text_is_expected(value: Any) -> None:
    with pytest.raises(FormatError, match=r"^measured\.layer: expected a name"):
        Query.from_json({"measured": {"layer": value, "above": -1}})
    with pytest.raises(FormatError, match=r"^start\.area: expected WKT"):
        Query.from_json({"start": {"area": value}})


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Query(names=("cup")), r"names may be several: write \('cup',\) with a comma"),
        (lambda: Query(tags="red"), "tags may be several"),
        (lambda: Query(layers="semantic"), "layers may be several"),
        (lambda: Query(ids=3), r"ids may be several: write \(3,\)"),
        (lambda: Query(where=Condition("in", Reference(is_asker=True))), "where may be several"),
        (lambda: Reference(names="table"), "names may be several"),
        (lambda: Reference(rooms="kitchen"), "rooms may be several"),
    ],
)
def test_one_without_its_comma_is_not_taken_letter_by_letter(
    make: Callable[[], object], message: str
) -> None:
    with pytest.raises(TypeError, match=message):
        make()


def test_lists_are_as_good_as_tuples() -> None:
    """Also where queries are compared and looked up."""
    table = Reference(names=["table"])  # type: ignore[arg-type]
    given = Query(names=["cup"], where=[Condition("near", table)])  # type: ignore[arg-type]
    known = Query(names=("cup",), where=(Condition("near", Reference(names=("table",))),))
    assert given == known
    assert hash(given) == hash(known)
