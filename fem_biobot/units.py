"""Quantities at the edge: text with a unit in, coherent floats (mm, mN, kPa, s, kg, uJ, rad) out, and back to text.

The only module that knows pint. Pint supplies the units; the number is read here, because pint evaluates whatever
arithmetic it is handed ("9**9**9 mm" never returns) and drops commas ("1,4 mm" becomes 14). Conversion is exact
(fractions, rounded once), so that "14 mm" and "1.4 cm" are the same float and a written design reads back identically.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from functools import lru_cache
from typing import Any

from fem_biobot.errors import DesignError

_PI = Fraction(Decimal("3.14159265358979323846264338327950288419717"))
_NUMBER = re.compile(r"\s*([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)\s*(.*?)\s*", re.DOTALL)
_NOT_FINITE = re.compile(r"\s*[+-]?(?:nan|inf|infinity)\b.*", re.IGNORECASE | re.DOTALL)
_FACTOR = r"[^\W\d_]+(?:_[^\W\d_]+)*(?:\^-?[1-9])?"
_UNIT = re.compile(rf"(?:1\s*/\s*)?{_FACTOR}(?:\s*[*/]\s*{_FACTOR}|\s+{_FACTOR})*")
_SPELLING = {"²": "^2", "³": "^3", "**": "^", "·": "*", "°": "deg", "%": "percent"}
_LONGEST = 100
_MOST_BITS = 200  # Python refuses to print integers of thousands of digits


@dataclass(frozen=True)
class Dimension:
    """What kind of quantity a key holds.

    Attributes
    ----------
    words
        How a message calls it ("a length").
    typical
        A number for examples.
    written
        The unit in which the quantity is written back.
    units
        Units read without pint, as factors to the coherent unit.
    """

    words: str
    typical: str
    written: str
    units: Mapping[str, Fraction]

    @property
    def example(self) -> str:
        """A text that is accepted."""
        return f"{self.typical} {self.written}"


# By coherent unit: the unit is the name of the dimension.
DIMENSIONS: Mapping[str, Dimension] = {
    "mm": Dimension(
        "a length",
        "14",
        "mm",
        {"mm": Fraction(1), "um": Fraction(1, 1000), "cm": Fraction(10), "m": Fraction(1000)},
    ),
    "mN": Dimension("a force", "1.4", "mN", {"mN": Fraction(1), "uN": Fraction(1, 1000), "N": Fraction(1000)}),
    "kPa": Dimension("a stress", "319.4", "kPa", {"kPa": Fraction(1), "Pa": Fraction(1, 1000), "MPa": Fraction(1000)}),
    "s": Dimension("a time", "0.5", "s", {"s": Fraction(1), "ms": Fraction(1, 1000)}),
    "kg": Dimension("a mass", "1e-6", "kg", {"kg": Fraction(1), "g": Fraction(1, 1000)}),
    "uJ": Dimension("an energy", "1", "uJ", {"uJ": Fraction(1), "mN mm": Fraction(1)}),
    "kg/mm^3": Dimension(
        "a density",
        "1.12e-3",
        "g/mm^3",
        {"kg/mm^3": Fraction(1), "g/mm^3": Fraction(1, 1000), "g/cm^3": Fraction(1, 10**6)},
    ),
    "kPa s": Dimension(
        "a viscosity",
        "1",
        "mPa s",
        {"kPa s": Fraction(1), "mPa s": Fraction(1, 10**6), "Pa s": Fraction(1, 1000)},
    ),
    "rad": Dimension("an angle", "90", "deg", {"deg": _PI / 180, "rad": Fraction(1)}),
    "Hz": Dimension("a frequency", "2", "Hz", {"Hz": Fraction(1), "1/s": Fraction(1)}),
    "1/s": Dimension("a rate", "10", "1/s", {"1/s": Fraction(1), "Hz": Fraction(1)}),
    "mM": Dimension(
        "a concentration",
        "0.2",
        "mM",
        {"mM": Fraction(1), "uM": Fraction(1, 1000), "mol/m^3": Fraction(1), "M": Fraction(1000)},
    ),
    "mM/s": Dimension(
        "a rate of consumption",
        "0.01",
        "mM/s",
        {"mM/s": Fraction(1), "uM/s": Fraction(1, 1000), "mol/m^3/s": Fraction(1)},
    ),
    "mm^2/s": Dimension(
        "a diffusivity",
        "1.7e-3",
        "mm^2/s",
        {"mm^2/s": Fraction(1), "um^2/s": Fraction(1, 10**6), "cm^2/s": Fraction(100), "m^2/s": Fraction(10**6)},
    ),
    "mm/s": Dimension(
        "a speed", "0.01", "mm/s", {"mm/s": Fraction(1), "um/s": Fraction(1, 1000), "m/s": Fraction(1000)}
    ),
    "1": Dimension("a number", "0.9", "", {"": Fraction(1), "%": Fraction(1, 100), "percent": Fraction(1, 100)}),
}


def expected_text(unit: str, number: str | None = None) -> str:
    """Words for what a key of this dimension expects, for messages.

    Parameters
    ----------
    unit
        Coherent unit, one of `DIMENSIONS`.
    number
        The number that stood there without a unit, to be used in the example.
    """
    dimension = DIMENSIONS[unit]
    if unit == "1":
        return "a number without unit, or in percent"
    if number is None or unit == "rad":  # a bare angle is as likely meant in radians
        return f'{dimension.words} with its unit, such as "{dimension.example}"'
    return f'{dimension.words} with its unit, such as "{number} {dimension.written}"'


def shown(value: object) -> str:
    """A value as a message quotes it: on one line, at most 60 characters."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "a section"
    if isinstance(value, list | tuple):
        return "a list"
    if isinstance(value, int) and value.bit_length() > _MOST_BITS:
        return "a huge whole number"
    text = json.dumps(value, ensure_ascii=False) if isinstance(value, str) else " ".join(str(value).split())
    return text if len(text) <= 60 else text[:57] + "..."


def one_line(text: str) -> str:
    """A name or path for a message: whole where it is short of 300 characters, line breaks and the like escaped."""
    escaped = text if text.isprintable() else json.dumps(text)[1:-1]
    return escaped if len(escaped) <= 300 else escaped[:297] + "..."


def parse_quantity(value: object, unit: str, key: str) -> float:
    """Number of a quantity in its coherent unit.

    Parameters
    ----------
    value
        Text such as "319.4 kPa"; for the dimensionless ("1") also a bare number or a percentage.
    unit
        Coherent unit, one of `DIMENSIONS`.
    key
        Full dotted name of the key, for the message.

    Returns
    -------
    float
        The value in `unit`, correctly rounded; texts that mean the same quantity give the same float.

    Raises
    ------
    DesignError
        No unit, an unknown one, one of another dimension, not finite, or not a number.
    """

    def refuse(why: str, number: str | None = None) -> DesignError:
        return DesignError(f"{key}: found {shown(value)}{why}, expected {expected_text(unit, number)}")

    huge = isinstance(value, int) and value.bit_length() > _MOST_BITS
    if isinstance(value, bool) or huge or not isinstance(value, int | float | str):
        raise refuse("")
    text = value if isinstance(value, str) else repr(value)
    if _NOT_FINITE.fullmatch(text):
        raise refuse(" (not finite)")
    match = _NUMBER.fullmatch(text)
    if match is None or len(text) > _LONGEST:
        raise refuse(" (not a number with a unit)")
    number, unit_text = match[1], match[2]
    if not unit_text and unit != "1":
        raise refuse(" (no unit)", number)
    try:
        factor = DIMENSIONS[unit].units.get(unit_text) or _pint_factor(unit_text, unit)
    except LookupError as error:
        raise refuse(f" ({error.args[0]})") from None
    if factor is None:
        raise refuse(f" (not {DIMENSIONS[unit].words})")
    # Sized as a float first: the exact fraction of "1e999999999" would fill the memory.
    if not math.isfinite(float(number)):
        raise refuse(" (not finite)")
    if float(number) == 0.0:
        return 0.0
    try:
        return float(Fraction(Decimal(number)) * factor)
    except OverflowError:
        raise refuse(" (not finite)") from None


def format_quantity(value: float, unit: str, *, digits: int | None = None) -> str:
    """Text of a coherent value in the unit that is usual for it, such as "14 mm", "90 deg" or "1.12e-3 g/mm^3".

    Parameters
    ----------
    value
        Finite number in the coherent unit.
    unit
        Coherent unit, one of `DIMENSIONS`.
    digits
        Significant digits; without it every digit that `parse_quantity` needs to return the identical float.
    """
    if digits is not None:
        value = float(f"{value:.{digits}g}") if unit != "rad" else value
    if unit == "rad":
        return _angle_text(value, digits)
    written = DIMENSIONS[unit].written
    factor = DIMENSIONS[unit].units[written]
    number = Decimal(repr(float(value) + 0.0)) * factor.denominator / factor.numerator
    return f"{_plain(number)} {written}".rstrip()


def _angle_text(value: float, digits: int | None) -> str:
    """Degrees where some short number of them gives back the very float, radians otherwise."""
    degrees = math.degrees(value)
    if digits is not None:
        return f"{_plain(Decimal(f'{degrees:.{digits}g}'))} deg"
    for precision in (15, 16, 17):
        text = f"{_plain(Decimal(f'{degrees:.{precision}g}'))} deg"
        if parse_quantity(text, "rad", "angle") == value:
            return text
    return f"{value!r} rad"


def _plain(number: Decimal) -> str:
    """Decimal without trailing zeros, with an exponent only where zeros would pile up."""
    number = number.normalize()
    if number == 0:
        return "0"
    return format(number, "f") if -4 <= number.adjusted() < 16 else format(number, "e").replace("e+", "e")


@lru_cache(maxsize=1)
def _registry() -> Any:
    """Pint's units with exact decimal factors; built at first need, since that takes half a second."""
    import pint

    number_type: Any = Decimal  # the annotation of pint knows float only
    return pint.UnitRegistry(non_int_type=number_type)


@lru_cache(maxsize=256)
def _pint_factor(unit_text: str, unit: str) -> Fraction | None:
    """Factor from any unit to the coherent one, None where the dimension differs; LookupError for no such unit.

    Compared are base units, not pint's dimensionality, which takes an angle for a pure number and rpm for Hz.
    """
    import pint

    if unit == "1":
        return None
    spelt = unit_text
    for mark, plain in _SPELLING.items():
        spelt = spelt.replace(mark, plain)
    if not _UNIT.fullmatch(spelt):
        raise LookupError("not a number with a unit")
    units = _registry()
    try:
        factor, base = units.get_base_units(units.parse_units(spelt))
    except pint.UndefinedUnitError as error:
        names = error.unit_names
        raise LookupError(f"unknown unit {names if isinstance(names, str) else ', '.join(names)}") from None
    except Exception:  # pint's parser fails in many ways on what is no unit
        raise LookupError("not a number with a unit") from None
    coherent_factor, coherent_base = units.get_base_units(units.parse_units(unit))
    if base != coherent_base:
        return None
    return Fraction(factor) / Fraction(coherent_factor)
