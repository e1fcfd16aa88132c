"""Numbers with units: ``5 mm``, ``2 deg``, ``1e-4 N m s/rad``. A plain number is in SI units."""

import re
from functools import cache
from typing import Any

from pydantic import BeforeValidator

from physics_prior.inertia import LARGEST_NUMBER

Dimensions = tuple[float, float, float, float]
"""Exponents of metre, kilogram, second and radian; an angle does not pass for a plain number."""

_SYMBOLS: dict[str, tuple[float, Dimensions]] = {
    "m": (1.0, (1, 0, 0, 0)),
    "g": (1e-3, (0, 1, 0, 0)),
    "s": (1.0, (0, 0, 1, 0)),
    "rad": (1.0, (0, 0, 0, 1)),
    "deg": (0.017453292519943295, (0, 0, 0, 1)),
    "Hz": (1.0, (0, 0, -1, 0)),
    "N": (1.0, (1, 1, -2, 0)),
    "J": (1.0, (2, 1, -2, 0)),
    "W": (1.0, (2, 1, -3, 0)),
    "Pa": (1.0, (-1, 1, -2, 0)),
}
_PREFIXES = {"n": 1e-9, "u": 1e-6, "µ": 1e-6, "m": 1e-3, "c": 1e-2, "k": 1e3, "M": 1e6}
_QUANTITY = re.compile(r"\s*([-+]?(?:\.\d+|\d+\.?\d*)(?:[eE][-+]?\d+)?)\s*(.{0,60}?)\s*", re.ASCII)
_FACTOR = re.compile(r"(sqrt\()?([a-zA-Z\u00b5]+)(?:\^(-?\d(?:\.\d)?))?(\))?", re.ASCII)


def parse_quantity(value: Any, *units: str) -> float:
    """Return a quantity in SI units.

    Args:
        value: a number in SI units, or a text of a number and, optionally, a unit.
        units: units that would do, such as "m/s^2", or any of the same dimensions; "" is a plain number.

    Raises:
        ValueError: not a number, not finite, an unknown unit, or one of other dimensions.
    """
    wanted = " or ".join(f"in {unit}" if unit else "without unit" for unit in units)
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value)
    match = _QUANTITY.fullmatch(value) if isinstance(value, str) else None
    if match is None:
        raise ValueError(f"{value!r:.80} is not a number: give one {wanted}")
    number, unit = float(match[1]), match[2]
    scale = 1.0
    if unit:
        try:
            scale, dimensions = parse_unit(unit)
        except ValueError as error:
            raise ValueError(f"{value[:80]!r} is not valid: {error}; give a number {wanted}") from None
        if dimensions not in [parse_unit(each)[1] for each in units]:
            raise ValueError(f"{value[:80]!r} is not a quantity {wanted}: give a number {wanted}")
    if not abs(number * scale) <= LARGEST_NUMBER:  # written so that NaN fails too
        raise ValueError(f"{value[:80]!r} is too large: numbers go up to {LARGEST_NUMBER:g}")
    return number * scale


@cache
def parse_unit(unit: str) -> tuple[float, Dimensions]:
    """Return scale to SI and dimensions of a unit: a slash divides by the one factor after it.

    A factor is a symbol (m g s rad deg Hz N J W Pa) with an optional prefix (n u m c k M) and exponent (s^2,
    s^0.5), or the square root of a symbol, sqrt(s).

    Raises:
        ValueError: an unknown symbol or spelling.
    """
    scale = 1.0
    total = [0.0, 0.0, 0.0, 0.0]
    for number, group in enumerate(unit.split("/")):
        factors = group.split()
        if not factors and unit:
            raise ValueError(f"unit {unit!r} has nothing beside its slash")
        for place, factor in enumerate(factors):
            match = _FACTOR.fullmatch(factor)
            if match is None or bool(match[1]) != bool(match[4]):
                raise ValueError(f"unit {unit!r} is unknown at {factor!r}")
            symbol_scale, dimensions = _symbol(match[2])
            exponent = float(match[3] or 1) * (0.5 if match[1] else 1.0)
            exponent *= -1.0 if number > 0 and place == 0 else 1.0
            scale *= symbol_scale**exponent
            total = [sum_ + exponent * each for sum_, each in zip(total, dimensions, strict=True)]
    return scale, (total[0], total[1], total[2], total[3])


def quantity(*units: str) -> BeforeValidator:
    """Return a pydantic annotation that accepts plain numbers and texts in any of the units' dimensions."""
    return BeforeValidator(lambda value: parse_quantity(value, *units))


def stated_units(description: str | None) -> tuple[str, ...]:
    """Units that the description of an effect's parameter opens with: "m, in the frame of part" gives ("m",).

    "joint name -> N m s/rad (revolute) or N s/m (prismatic); >= 0" gives both units; a text that opens
    with no unit gives none.
    """
    head = re.split(r"[,;:]", re.sub(r"(?<!sqrt)\(.*?\)", "", description or ""))[0].split("->")[-1]
    units = tuple(" ".join(part.split()) for part in head.split(" or "))
    try:
        for unit in units:
            parse_unit(unit)
    except ValueError:
        return ()
    return units if all(units) else ()


def _symbol(symbol: str) -> tuple[float, Dimensions]:
    if symbol in _SYMBOLS:
        return _SYMBOLS[symbol]
    if symbol[:1] in _PREFIXES and symbol[1:] in _SYMBOLS:
        scale, dimensions = _SYMBOLS[symbol[1:]]
        return _PREFIXES[symbol[0]] * scale, dimensions
    raise ValueError(f"unit {symbol!r} is unknown")
