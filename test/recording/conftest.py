"""Random messages of every type, made from the types' own statement of their fields."""

import pytest
from hypothesis import strategies as st

from physics_prior.recording.definitions import fields_of
from physics_prior.recording.wire import MESSAGE_CLASSES, Primitive

SCALARS = {
    "bool": st.booleans(),
    "byte": st.integers(0, 255),
    "int32": st.integers(-(2**31), 2**31 - 1),
    "uint32": st.integers(0, 2**32 - 1),
    # Below the largest float32, which rclpy's own check refuses by a rounding; NaN equals nothing in its comparison.
    "float32": st.floats(-(2.0**127), 2.0**127, width=32) | st.sampled_from([float("inf"), float("-inf")]),
    "float64": st.floats(allow_nan=False),
    "string": st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=9),
}


def _messages_of(cls):
    fields = fields_of(cls) if cls.__dataclass_fields__ else ()
    return st.builds(cls, **{field.name: _values_of(field) for field in fields})


def _values_of(field):
    if not isinstance(field.element, Primitive):
        one = _messages_of(field.element)
    elif field.element.name == "uint8":
        return st.binary(max_size=9)
    else:
        one = SCALARS[field.element.name]
    if not field.is_array:
        return one
    return st.lists(one, min_size=field.length or 0, max_size=field.length or 3)


@pytest.fixture(scope="session")
def messages_of():
    """Strategy of the messages of each class; made once, for Marker's takes a while."""
    return {cls: _messages_of(cls) for cls in MESSAGE_CLASSES.values()}


@pytest.fixture(scope="session")
def any_message(messages_of):
    return st.one_of(list(messages_of.values()))
