"""Numbers with units."""

import contextlib
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from physics_prior.effects import REGISTRY
from physics_prior.scene.quantity import parse_quantity, parse_unit, stated_units


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("5 mm", "m", 5e-3),
        ("5mm", "m", 5e-3),
        ("-2 deg", "rad", -math.pi / 90),
        ("1.5 kHz", "Hz", 1500.0),
        ("1.5 kHz", "rad/s", None),
        ("20 us", "s", 2e-5),
        ("20 µs", "s", 2e-5),
        ("300 g", "kg", 0.3),
        ("1e-4 N m s/rad", "N m s/rad", 1e-4),
        ("3 N mm s/deg", "N m s/rad", 3e-3 * 180 / math.pi),
        ("2 kg m^2/s^2", "J", 2.0),
        ("9.81 m/s/s", "m/s^2", 9.81),
        ("4 N/sqrt(Hz)", "N sqrt(s)", 4.0),
        ("4 N s^0.5", "N sqrt(s)", 4.0),
        ("8.1e-4 kg m^2", "kg m^2", 8.1e-4),
        ("7", "m", 7.0),
        (" +.5e1 ", "m", 5.0),
        (3, "m", 3.0),
        (0.1, "", 0.1),
        ("0.1", "", 0.1),
        ("5 kg", "m", None),
        ("5 rad", "", None),
        ("5 m", "rad", None),
        ("5 1/s", "Hz", None),
        ("5 furlong", "m", None),
        ("5 m/", "m", None),
        ("5 /m", "m", None),
        ("5 m^99", "m", None),
        ("5 sqrt(s", "s", None),
        ("nan", "m", None),
        ("inf m", "m", None),
        ("1e99 m", "m", None),
        ("1_0", "m", None),
        ("0x1p3", "m", None),
        ("", "m", None),
        ("m", "m", None),
        ("\u0665 m", "m", None),  # a digit, but not an ASCII one
        (True, "m", None),
        (None, "m", None),
        ([1], "m", None),
    ],
)
def test_quantities(text, unit, value):
    if value is None:
        with pytest.raises(ValueError, match=r"give a number|give one|too large"):
            parse_quantity(text, unit)
    else:
        assert parse_quantity(text, unit) == pytest.approx(value, rel=1e-15)  # measured: at most 1 ulp


@given(st.floats(-1e50, 1e50), st.sampled_from(["m", "kg", "s", "rad", "N m s/rad", "m/s^2", ""]))
def test_a_number_written_with_its_si_unit_is_itself(number, unit):
    assert parse_quantity(f"{number!r} {unit}", unit) == number


@given(st.text(max_size=30), st.text("0123456789.eE+-nufkmM^/() sradHzNJWPµ", max_size=30))
def test_any_text_is_a_finite_number_or_refused(anything, likely):
    for text in (anything, likely, "1 " + likely):
        with contextlib.suppress(ValueError):
            assert math.isfinite(parse_quantity(text, "m", "s", ""))


def test_either_of_two_units_will_do():
    assert parse_quantity("1 deg", "m", "rad") == pytest.approx(math.pi / 180)
    assert parse_quantity("1 cm", "m", "rad") == 0.01
    with pytest.raises(ValueError, match="'1 s' is not a quantity in m or in rad: give a number in m or in rad"):
        parse_quantity("1 s", "m", "rad")


@pytest.mark.parametrize(
    ("description", "units"),
    [
        ("m, in the frame of `part`", ("m",)),
        ("m/s^2, world axes; standard gravity where left out", ("m/s^2",)),
        ("joint name -> N m s/rad (revolute, spherical) or N s/m (prismatic); >= 0", ("N m s/rad", "N s/m")),
        ("the part that is held; the published force acts on it", ()),
        ("", ()),
        (None, ()),
    ],
)
def test_units_stated_by_descriptions(description, units):
    assert stated_units(description) == units


def test_every_number_of_the_built_in_effects_states_its_unit():
    unitless = {
        "hinge": {"axis", "to_axis"},
        "weld": {"orientation"},
        "joint_limit": {"restitution", "restitution_deviation"},
        "ground_reaction": {"friction"},
        "contact": {
            *("orientation", "to_orientation", "friction", "restitution"),
            *("friction_deviation", "restitution_deviation", "impulse_deviation"),
        },
    }
    for kind, effect in REGISTRY.items():
        for name, field in effect.model_fields.items():
            if "float" in str(field.annotation) and name not in unitless.get(kind, set()):
                assert stated_units(field.description), f"{kind}.{name}: {field.description}"


def test_dimensions_do_not_depend_on_spelling():
    assert parse_unit("N m")[1] == parse_unit("J")[1] == parse_unit("kg m^2/s^2")[1]
    assert parse_unit("rad/s")[1] != parse_unit("Hz")[1]
