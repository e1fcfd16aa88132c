"""Andrews' squeezer mechanism, of the test set for initial value problems and A03 of the IFToMM library."""

import numpy as np

from physics_prior.effects.attachment import Attachment
from physics_prior.effects.spring import Spring
from physics_prior.inertia import MassProperties
from physics_prior.model import Joint, JointKind, Part, Tree
from physics_prior.studies.problems.mechanism import Benchmark, Run, largest
from physics_prior.studies.problems.reference_values import ANDREWS

XA, YA, XB, YB, XC, YC = -0.06934, -0.00227, -0.03635, 0.03273, 0.014, 0.072  # m; the crank turns about the origin
D, DA, E, EA = 0.028, 0.0115, 0.02, 0.01421
RR, RA = 0.007, 0.00092
SS, SA, SB, SC, SD = 0.035, 0.01874, 0.01043, 0.018, 0.02
TA, TB = 0.02308, 0.00916
U, UA, UB = 0.04, 0.01228, 0.00449
ZF, ZT, FA = 0.02, 0.04, 0.01421
TORQUE = 0.033  # N m, on the crank
STIFFNESS, REST_LENGTH = 4530.0, 0.07785  # N/m and m, of the spring from C to a point of K3

LINKS: tuple[tuple[str, str, str, tuple[float, float], float, float, tuple[float, float], float], ...] = (
    ("K1", "world", "beta", (0.0, 0.0), 0.04325, 2.194e-6, (RA, 0.0), -0.0617138900142764496),
    ("K2", "K1", "Theta", (RR, 0.0), 0.00365, 4.410e-7, (-DA, 0.0), 0.0),
    ("K3", "world", "gamma", (XB, YB), 0.02373, 5.255e-6, (SB, -SA), 0.45527981916307038),
    ("K5", "world", "delta", (XA, YA), 0.07050, 1.169e-5, (TA, TB), 0.48736497954384255),
    ("K4", "K5", "Phi", (ZT, 0.0), 0.00706, 5.667e-7, (0.0, EA - E), 0.22266839016588588),
    ("K7", "world", "epsilon", (XA, YA), 0.05498, 1.912e-5, (-UB, -UA), 1.2305474445498212),
    ("K6", "K7", "Omega", (0.0, -U), 0.00706, 5.667e-7, (ZF - FA, 0.0), -0.22266839016588588),
)
"""Part, what carries it, its angle, joint (m), mass (kg), inertia (kg m^2), centre of mass (m), angle at the start (rad)."""

COMPARED = ("beta", "Theta", "gamma", "Phi", "delta", "epsilon")
PUBLISHED = np.array(
    [
        15.81077119629904,
        -15.75637105984298,
        0.04082224013073101,
        -0.5347301163226948,
        0.5244099658805304,
        1.048080741042263,
    ]
)
"""rad, of those at 0.03 s as the test set prints them (PSIDE at 1e-14): on the motion, 1e-12 s off, which is 1e-9 rad."""


def andrews() -> Benchmark:
    """Seven bodies in a plane, three loops closed where K2, K3, K4 and K6 meet, driven by a torque, without gravity.

    Angles are those of the test set, so that links turn relative to what carries them; observed: six of them (Omega is
    -Phi), rad, every 0.01 s to 0.05 s.
    """
    parts, joints, start = [], [], []
    for part, parent, angle, (x, y), mass, moment, (cx, cy), at in LINKS:
        parts.append(Part(part, MassProperties(mass, np.array([cx, cy, 0.0]), moment * np.diag([0.5, 0.5, 1.0]))))
        joints.append(Joint(angle, JointKind.REVOLUTE, parent, part, np.array([x, y, 0.0])))
        start.append(at)
    tree = Tree(parts, joints)
    meeting = {"K3": (0.0, -SS, 0.0), "K4": (0.0, -E, 0.0), "K6": (ZF, 0.0, 0.0)}
    closed = [
        Attachment(name=f"meets_{part}", part=part, point=point, to="K2", at=(-D, 0.0, 0.0))
        for part, point in meeting.items()
    ]
    spring = Spring(part="K3", point=(SD, -SC, 0.0), at=(XC, YC, 0.0), stiffness=STIFFNESS, rest_length=REST_LENGTH)
    tau = np.zeros(tree.nv)
    tau[tree.link("beta").v] = TORQUE
    return Benchmark(
        tree,
        (spring, *closed),
        np.array(start),
        np.zeros(tree.nv),
        tau,
        observe=angles,
        times=ANDREWS[:, 0],
        values=ANDREWS[:, 1:],
        distance=largest,
    )


def angles(run: Run) -> np.ndarray:
    """(6,) rad, the compared angles."""
    return np.array([run.q[run.simulator.tree.link(angle).q.start] for angle in COMPARED])
