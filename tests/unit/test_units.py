"""Quantities at the edge: what is read, what is refused and how, and that what is written reads back."""

from __future__ import annotations

import math
import subprocess
import sys
from fractions import Fraction

import pytest

from fem_biobot.errors import DesignError
from fem_biobot.units import DIMENSIONS, _pint_factor, format_quantity, one_line, parse_quantity, shown

KEY = "part.key"


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("319.4 kPa", "kPa", 319.4),
        ("0.3194MPa", "kPa", 319.4),
        ("319.4 mN/mm^2", "kPa", 319.4),
        (" 1.4 cm ", "mm", 14.0),
        ("-0.1 mm", "mm", -0.1),
        ("+.5e1 mm", "mm", 5.0),
        ("680 µm", "mm", 0.68),
        ("0.5 inch", "mm", 12.7),
        ("600 uN", "mN", 0.6),
        ("1.4e-3 N", "mN", 1.4),
        ("1 ms", "s", 1e-3),
        ("2 min", "s", 120.0),
        ("3 g", "kg", 3e-3),
        ("2 mN*mm", "uJ", 2.0),
        ("2e-6 J", "uJ", 2.0),
        ("1.12e-3 g/mm^3", "kg/mm^3", 1.12e-6),
        ("1.12 g/cm**3", "kg/mm^3", 1.12e-6),
        ("1120 kg/m³", "kg/mm^3", 1.12e-6),
        ("2 Hz", "Hz", 2.0),
        ("2 1/s", "Hz", 2.0),
        ("0.002 kHz", "Hz", 2.0),
        ("90 deg", "rad", math.pi / 2),
        ("90°", "rad", math.pi / 2),
        ("80deg", "rad", math.radians(80)),
        ("0.5 turn", "rad", math.pi),
        ("1.2 rad", "rad", 1.2),
        ("0.9", "1", 0.9),
        (0.9, "1", 0.9),
        (1, "1", 1.0),
        ("90 %", "1", 0.9),
        ("90 percent", "1", 0.9),
        ("0 mm", "mm", 0.0),
        ("1e-99999999999 mm", "mm", 0.0),
    ],
)
def test_text_becomes_the_coherent_number(text: object, unit: str, value: float) -> None:
    """A quantity in any unit of its dimension is the float that exact arithmetic gives.

    Catches: a factor turned upside down, a conversion through rounded floats.
    """
    assert parse_quantity(text, unit, KEY) == value


@pytest.mark.parametrize(
    ("value", "unit", "words"),
    [
        (14, "mm", 'found 14 (no unit), expected a length with its unit, such as "14 mm"'),
        (2.5, "kPa", 'found 2.5 (no unit), expected a stress with its unit, such as "2.5 kPa"'),
        ("14", "mm", 'found "14" (no unit)'),
        ("1.57", "rad", 'found "1.57" (no unit), expected an angle with its unit, such as "90 deg"'),
        (90, "rad", "found 90 (no unit), expected an angle"),
        ("90 deg", "mm", "(not a length), expected a length"),
        ("14 mm", "rad", "(not an angle)"),
        ("14 mm^2", "mm", "(not a length)"),
        ("14 mm mm", "mm", "(not a length)"),
        ("3 kPa", "mN", "(not a force)"),
        ("20 degC", "mm", "(not a length)"),
        ("60 rpm", "Hz", "(not a frequency)"),
        ("6 rad/s", "Hz", "(not a frequency)"),
        ("0.9 mm", "1", "(not a number), expected a number without unit"),
        ("1 rad", "1", "(not a number)"),
        ("5 %", "mm", "(not a length)"),
        ("14 foo", "mm", "(unknown unit foo)"),
        ("3 kpa", "kPa", "(unknown unit kpa)"),
        ("14 m**9**9", "mm", "(not a number with a unit)"),
        ("9**9**9 mm", "mm", "(not a number with a unit)"),
        ("1,4 mm", "mm", "(not a number with a unit)"),
        ("mm", "mm", "(not a number with a unit)"),
        ("", "mm", "(not a number with a unit)"),
        ("14 mm/", "mm", "(not a number with a unit)"),
        ("__import__('os')", "mm", "(not a number with a unit)"),
        ("1" * 300 + " mm", "mm", "(not a number with a unit)"),
        ("nan mm", "mm", "(not finite)"),
        (math.nan, "1", "(not finite)"),
        (math.inf, "1", "(not finite)"),
        ("-inf", "1", "(not finite)"),
        ("1e999999999 mm", "mm", "(not finite)"),
        ("1e308 m", "mm", "(not finite)"),
        (True, "1", "found true, expected a number"),
        ([14], "mm", "found a list, expected a length"),
        ({"a": 1}, "mm", "found a section, expected a length"),
        (None, "mm", "found None, expected a length"),
        ("14\nfoo", "mm", "unknown unit foo"),
    ],
)
def test_refusals_name_the_key_the_finding_and_the_expectation(value: object, unit: str, words: str) -> None:
    """What is no quantity of the dimension is refused on one line that says all three things.

    Catches: an angle taken for a number, rpm for Hz, pint evaluating powers or dropping a comma, a swallowed reason.
    """
    with pytest.raises(DesignError) as caught:
        parse_quantity(value, unit, KEY)
    message = str(caught.value)
    assert message.startswith(f"{KEY}: found ")
    assert words in message
    assert ", expected " in message
    assert "\n" not in message
    assert len(message) < 200


@pytest.mark.parametrize("unit", DIMENSIONS)
@pytest.mark.parametrize("value", [0.1 + 0.2, 1.12e-6, 2 / 3, 1e-300, 6.02e23, 14.0, 1.0, 1.3962634015954636])
def test_what_is_written_reads_back_identically(value: float, unit: str) -> None:
    """Writing and reading return the very same float in every dimension.

    Catches: a value printed with too few digits, a scaled unit multiplied in floating point.
    """
    assert parse_quantity(format_quantity(value, unit), unit, KEY) == value


def test_angles_read_back_identically_whether_in_degrees_or_not() -> None:
    """Angles of a generic set come back as the same float; round degrees are written as such.

    Catches: degrees written where no short number of them is that float, 80 deg written as 80.00000000000001.
    """
    for i in range(1, 200):
        value = i * 0.0157319
        assert parse_quantity(format_quantity(value, "rad"), "rad", KEY) == value
    for degrees in range(181):
        assert format_quantity(parse_quantity(f"{degrees} deg", "rad", KEY), "rad") == f"{degrees} deg"


@pytest.mark.parametrize(
    ("value", "unit", "digits", "text"),
    [
        (14.0, "mm", None, "14 mm"),
        (-0.0, "mm", None, "0 mm"),
        (1.12e-6, "kg/mm^3", None, "0.00112 g/mm^3"),
        (1e-9, "1", None, "1e-9"),
        (1e22, "kPa", None, "1e22 kPa"),
        (0.1 + 0.2, "kPa", 3, "0.3 kPa"),
        (1.0, "rad", 3, "57.3 deg"),
        (1.0, "rad", None, "57.29577951308232 deg"),
        (140.0, "mm", 2, "140 mm"),
    ],
)
def test_text_is_in_the_usual_unit_without_noise(value: float, unit: str, digits: int | None, text: str) -> None:
    """Numbers are written plainly, rounded only where digits are asked for.

    Catches: trailing zeros, "1.4E+2", a negative zero.
    """
    assert format_quantity(value, unit, digits=digits) == text


@pytest.mark.parametrize("unit", DIMENSIONS)
def test_units_read_without_pint_agree_with_pint(unit: str) -> None:
    """The short table of common units states what pint states.

    Catches: a power of ten lost in the table.
    """
    for name, factor in DIMENSIONS[unit].units.items():
        if unit == "1":
            continue
        by_pint = _pint_factor(name, unit)
        assert by_pint is not None
        # pint's pi has 28 digits, everything else is exact
        assert abs(by_pint / factor - 1) <= Fraction(1, 10**26)


def test_common_units_do_not_load_pint() -> None:
    """Reading "14 mm" leaves pint unimported, which would take half a second of every command.

    Catches: an import of pint at the top, a table that is not asked first.
    """
    code = "import sys, fem_biobot.units as u; u.parse_quantity('14 mm', 'mm', 'k'); sys.exit('pint' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_quoted_values_and_names_stay_on_one_short_line() -> None:
    """Whatever a message quotes has no line break and a bounded length; a usual path stays whole.

    Catches: a raw line break in a message, a path cut before its file name.
    """
    assert shown("a\nb") == '"a\\nb"'
    assert len(shown("x" * 500)) == 60
    assert one_line("a\nb") == "a\\nb"
    assert one_line("/long/" * 30 + "f.toml").endswith("f.toml")
    assert len(one_line("x" * 5000)) == 300


def test_a_whole_number_too_long_to_print_is_refused() -> None:
    """An integer of thousands of digits, which Python refuses to print, ends in a message like any other.

    Catches: a ValueError from Python's limit on integer strings.
    """
    with pytest.raises(DesignError, match=r"part.key: found a huge whole number, expected a number"):
        parse_quantity(10**5000, "1", KEY)
