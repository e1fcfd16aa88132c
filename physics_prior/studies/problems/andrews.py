"""Andrews' squeezer mechanism, of the test set for initial value problems and A03 of the IFToMM library."""

A, B, C = (-0.06934, -0.00227), (-0.03635, 0.03273), (0.014, 0.072)  # m, fixed points; the crank turns about the origin
TORQUE = 0.033  # N m, on the crank
STIFFNESS, REST_LENGTH = 4530.0, 0.07785  # N/m and m, of the spring between C and D on K3

START = {
    "beta": -0.0617138900142764496,
    "Theta": 0.0,
    "gamma": 0.45527981916307038,
    "delta": 0.48736497954384255,
    "Phi": 0.22266839016588588,
    "epsilon": 1.2305474445498212,
    "Omega": -0.22266839016588588,
}
"""rad, in the order of the tree: the loops close at these."""

PUBLISHED = {
    "beta": 15.81077119629904,
    "Theta": -15.75637105984298,
    "gamma": 0.04082224013073101,
    "Phi": -0.5347301163226948,
    "delta": 0.5244099658805304,
    "Omega": 0.5347301163226948,
    "epsilon": 1.048080741042263,
}
"""rad, at 0.03 s as the test set prints them (PSIDE at 1e-14): on the trajectory, 1e-12 s off, which is 1e-9 rad."""
