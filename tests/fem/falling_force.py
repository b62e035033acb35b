"""An artificial grasp of one unknown, whose force falls from 2.5 N to 2 N while the fingers close from 1 to 2 mm."""

import numpy as np

from softjaw.fem.contact.problem import Control

MM = 1e-3


def force(x):
    """Force [N] at a closing displacement of x [mm]."""
    return x**3 - 4.5 * x**2 + 6 * x


def crossings(F):
    """Closing displacements with this force [mm], ascending."""
    roots = np.roots([1.0, -4.5, 6.0, -F])
    return np.sort(roots[np.abs(roots.imag) < 1e-9].real)


class Curve:
    """One unknown, the closing displacement."""

    control, friction = Control(closing=0.0), None
    thickness, share, rounding = 20 * MM, 1.0, 0.0

    def force_scale(self, closing):
        return 1.0

    def normal_force(self, x):
        return float(force(x[0] / MM))

    def closing(self, x):
        return float(x[0])


class Crossings:
    """Finds the state under displacement control; under force control the crossing that is nearest to the start.

    One that is not ``close`` [mm] is passed: then it finds the last crossing, as Newton's method may.
    """

    def __init__(self, problem, close=np.inf):
        self.problem, self.close, self.at = problem, close, None

    def solve(self, x, tolerance, *limits):
        control = self.problem.control
        self.at = np.array([control.closing])
        if control.force is not None:
            places = MM * crossings(control.force)
            nearest = places[[np.abs(places - x[0]).argmin()]]
            self.at = nearest if abs(nearest - x) < self.close * MM else places[-1:]
        return self.at, 1

    def is_at(self, x):
        return x is self.at

    def answer(self, b):
        return b

    def negative_eigenvalues(self, entries):
        return 1
