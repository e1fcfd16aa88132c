"""Every hard case, in the order of the list."""

from physics_prior.errors import PhysicsPriorError
from physics_prior.studies.stability import inputs, loops, models, ratios, smooth, spinning, stiff, touching, turning
from physics_prior.studies.stability.case import Case

CASES: tuple[Case, ...] = tuple(
    sorted(
        (
            thing
            for family in (smooth, loops, stiff, spinning, ratios, turning, models, touching, inputs)
            for thing in vars(family).values()
            if isinstance(thing, Case)
        ),
        key=lambda case: case.id,
    )
)


def chosen(names: list[str]) -> tuple[Case, ...]:
    """The cases of these numbers or keys, all of them where none is given.

    Raises:
        PhysicsPriorError: a name that is none.
    """
    known = {name: case for case in CASES for name in (str(case.id), case.key)}
    for name in names:
        if name not in known:
            keys = ", ".join(f"{case.id} {case.key}" for case in CASES)
            raise PhysicsPriorError(f"case '{name}' is unknown; known are {keys}")
    wanted = {known[name].id for name in names}
    return tuple(case for case in CASES if case.id in wanted or not names)
