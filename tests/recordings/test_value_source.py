"""The text of `--value`: a topic, the field of its messages, and settings."""

from __future__ import annotations

import pytest

from hypermap.core.errors import HypermapError
from hypermap.recordings.samples import ValueSource


def test_a_source_is_a_topic_with_a_field_and_settings() -> None:
    assert ValueSource.parse("/warmth") == ValueSource("/warmth")
    text = "/wifi:aps[0].rssi, unit=dBm,censored-below=-95,quantity=wifi,sensor-frame=antenna"
    found = ValueSource.parse(text)
    assert found == ValueSource(
        "/wifi", "aps[0].rssi", "wifi", "dBm", censored_below=-95, sensor_frame="antenna"
    )


@pytest.mark.parametrize(
    ("text", "measured", "name"),
    [
        ("/warmth", "temperature", "temperature"),
        ("/robot/warmth", "", "robot_warmth"),
        ("/wifi:level", "", "level"),
        ("/wifi:level,quantity=radio", "level", "radio"),
    ],
)
def test_the_layer_is_named_by_the_quantity_or_what_is_measured(
    text: str, measured: str, name: str
) -> None:
    assert ValueSource.parse(text).name(measured) == name


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "a value is TOPIC or TOPIC:FIELD"),
        (":rssi", "a value is TOPIC or TOPIC:FIELD"),
        ("/wifi,unit", "unit needs a text"),
        ("/wifi,unit=", "unit needs a text"),
        ("/wifi,field=rssi", "there is no setting 'field'"),
        ("/wifi,censored-below=low", "censored-below is not a number: 'low'"),
        ("/wifi,censored-below=nan", "censored-below is not a number"),
    ],
)
def test_another_text_is_refused(text: str, said: str) -> None:
    with pytest.raises(HypermapError, match=said):
        ValueSource.parse(text)
