from __future__ import annotations

import math

import pytest

from imclab.report.numbers import quantity
from imclab.report.wording import worded


@pytest.mark.parametrize(
    ("value", "unit", "stderr", "style", "text"),
    [
        (0.36788, "1", 0.00482, "plain", "0.3679 ± 0.0048"),
        (-0.0525, "1", 0.0131, "signed percent", "−5.2 ± 1.3\u202f%"),
        (0.0525, "1", 0.0131, "signed percent", "+5.2 ± 1.3\u202f%"),
        (0.30, "1", None, "share", "30\u202f%"),
        (0.002, "1", None, "share", "<\u202f1\u202f%"),
        (0.00849, "1", None, "percent", "0.849\u202f%"),
        (8.2e-9, "s", None, "plain", "8.2\u202fns"),
        (1.747e-12, "J", 1.05e-14, "plain", "1.747 ± 0.010\u202fpJ"),
        (3.63, "s", None, "plain", "3.63\u202fs"),
        (96.2, "counts", 0.1, "plain", "96.20 ± 0.10\u202fcounts"),
        (2_410_000, "1", None, "count", "2.41·10⁶"),
        (37634, "1", None, "count", "37\u202f634"),
        (6726.4, "1/s", None, "bare", "6\u202f726"),
        (7e-25, "1", None, "probability", "<\u202f0.001"),
        (0.99999, "1", None, "probability", ">\u202f0.999"),
        (0.25, "1", None, "probability", "0.250"),
        (0.87112, "1", 0.0119, "compact", "0.871(12)"),
        (44.882, "dB", 0.023, "compact", "44.882(23)"),
        (0.0, "1", 0.0, "plain", "0"),
        (3.2e-5, "1", None, "plain", "3.20·10⁻⁵"),
        (math.inf, "dB", 0.0, "plain", "∞"),
        (math.nan, "1", math.nan, "percent", "–"),
        (12.5, "dB", math.nan, "plain", "12.5\u202fdB"),
    ],
)
def test_numbers_read_as_a_reader_wants_them(
    value: float, unit: str, stderr: float | None, style: str, text: str
) -> None:
    assert worded(quantity(value, unit, stderr), style) == text


def test_rounding_never_moves_a_value_by_more_than_a_tenth_of_its_uncertainty() -> None:
    for exponent in range(-6, 4):
        stderr = 3.14159 * 10.0**exponent
        text = worded(quantity(2.7182818, "1", stderr), "plain").split(" ± ")
        assert abs(float(text[0]) - 2.7182818) <= max(0.1 * stderr, 0.5)
        assert float(text[1]) == pytest.approx(stderr, rel=0.05)
