"""Which topic has samples of a quantity, and how they are to be read: the text of `--value`."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hypermap.core.errors import HypermapError, did_you_mean

_KEYS = {
    "quantity": "quantity",
    "unit": "unit",
    "sample-unit": "sample_unit",
    "censored-below": "censored_below",
    "sensor-frame": "sensor_frame",
}
_FORM = "a value is TOPIC or TOPIC:FIELD, and then ,KEY=TEXT for each setting, as {}"
_EXAMPLE = "/wifi:rssi,unit=dBm,censored-below=-95"


@dataclass(frozen=True)
class ValueSource:
    """A topic with samples; the other attributes are like the options of `hypermap values`.

    Attributes:
        topic: its name.
        field: path of the number in a message, as for `reading_of`; None for the number of the
            message type.
        quantity: what is measured, the name of the layer; None to take it from field or topic.
        unit: of the layer; None for that of the samples.
        sample_unit: of the samples, if the messages do not contain it.
        censored_below: detection limit of the sensor; None if NaN has no meaning.
        sensor_frame: tf frame of the sensor; None for that of the messages.
    """

    topic: str
    field: str | None = None
    quantity: str | None = None
    unit: str | None = None
    sample_unit: str | None = None
    censored_below: float | None = None
    sensor_frame: str | None = None

    @classmethod
    def parse(cls, text: str) -> ValueSource:
        """Return the source that a text describes.

        Raises:
            HypermapError: If the text does not have this form.

        >>> source = ValueSource.parse("/wifi:rssi,unit=dBm")
        >>> source.topic, source.field, source.unit, source.name("")
        ('/wifi', 'rssi', 'dBm', 'rssi')
        """
        where, *pairs = text.strip().split(",")
        topic, _, field = where.partition(":")
        if not topic.strip("/~ "):
            raise HypermapError(f"{text!r}: {_FORM.format(_EXAMPLE)}")
        given: dict[str, str] = {}
        for pair in pairs:
            key, sign, said = pair.partition("=")
            if key.strip() not in _KEYS:
                hint = did_you_mean(key.strip(), list(_KEYS))
                raise HypermapError(f"{text!r}: there is no setting {key.strip()!r}; {hint}")
            if not sign or not said.strip():
                raise HypermapError(f"{text!r}: {key.strip()} needs a text, as in {_EXAMPLE}")
            given[_KEYS[key.strip()]] = said.strip()
        limit = _limit(text, given.pop("censored_below", None))
        return cls(topic.strip(), field.strip() or None, censored_below=limit, **given)

    def name(self, measured: str) -> str:
        """Return the name of the layer.

        Args:
            measured: what the kind of message measures; empty where it does not say.
        """
        return self.quantity or measured or self.field or self.topic.strip("/~").replace("/", "_")


def _limit(text: str, said: str | None) -> float | None:
    if said is None:
        return None
    try:
        number = float(said)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise HypermapError(f"{text!r}: censored-below is not a number: {said!r}")
    return number
