"""The pad for small strains, reduced once to the nodes of its front.

The tangent of every foam at rest is that of a linear elastic body with the same modulus and Poisson's ratio. With its
back on a sheet that has travelled by ``delta``, the front answers to forces ``f`` on its nodes with ``u = delta e_z
+ C f``; the compliance ``C`` takes one factorisation and serves every object that the pad is pressed on.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.contact.pattern import Pattern, add_up
from softjaw.fem.materials import Material, material, stress
from softjaw.fem.pad.foam import Foam
from softjaw.fem.pad.mesh import Pad
from softjaw.fem.petsc import Factors

FloatArray = NDArray[np.float64]
AT_ONCE = 256  # right-hand sides; bounds the memory


def linearised(pad: Pad) -> Pad:
    """The same pad of linear elastic material, with the constants that its foam has at rest."""
    law = pad.material
    material_at_rest = material("linear", law.shear_modulus, law.poisson_ratio)
    return Pad(pad.shape, material_at_rest, pad.symmetry, pad.contact, pad.sheet)


def departure(law: Material, strain: float) -> float:
    """How far a law is from a straight line at a strain: the strain itself, or the error of the linear stress [-].

    The latter in confined tension and compression, ``|P / (M e) - 1|`` with ``M = lambda + 2 G``. Blatz-Ko foam has
    about twice the strain, foams that harden or soften more have more.
    """
    nu = law.poisson_ratio
    modulus = 2.0 * law.shear_modulus * (1.0 - nu) / (1.0 - 2.0 * nu)
    if law.law == "linear":
        return 0.0
    if strain >= 1.0:
        return float("inf")
    found, P = [strain], np.empty((3, 3))
    for e in (strain, -strain) if strain > 0 else ():
        F = np.diag([1.0, 1.0, 1.0 + e])
        stress(law.number, F, np.linalg.inv(F), 1.0 + e, law.parameters, P, np.empty((0, 0, 0, 0)))
        found.append(abs(P[2, 2] / (modulus * e) - 1.0))
    return float(max(found))


class CondensedPad:
    """Answer of a linear elastic pad to forces on its front.

    Parameters
    ----------
    pad : Pad
        Of linear material, see `linearised`.

    Attributes
    ----------
    dofs : (k,) array
        Unknowns of the free displacements of the front, rising.
    position : (free displacements + 1,) array
        Where each unknown of the pad stands among them; -1 for others, the travel among those.
    approach : (k,) array
        1 for displacements along the approach, 0 for those across it.
    compliance : (k, k) array
        Displacements of the front relative to the sheet per force on the front [m/N]; symmetric.
    """

    def __init__(self, pad: Pad) -> None:
        if pad.material.law != "linear":
            raise ValueError(f"only a linear pad can be condensed, found '{pad.material.law}'; take linearised(pad)")
        self.pad = pad
        foam = Foam(pad)
        free = (foam.rows < pad.travel_dof) & (foam.columns < pad.travel_dof)
        rows, columns = np.where(free, foam.rows, -1), np.where(free, foam.columns, -1)
        values = np.empty(foam.rows.size)
        foam.stiffness(np.zeros(pad.size), values)
        pattern = Pattern(pad.travel_dof, rows, columns)
        add_up(pattern.slots(rows, columns), values, pattern.values)
        self._factors = Factors(pattern)
        front = pad.dofs[pad.front_nodes]
        self.dofs = np.sort(front[front >= 0])
        self.position = np.full(pad.travel_dof + 1, -1)
        self.position[self.dofs] = np.arange(len(self.dofs))
        self.approach = np.isin(self.dofs, front[:, 2]).astype(float)
        self.compliance = self._compliance()

    def _compliance(self) -> FloatArray:
        k = len(self.dofs)
        C = np.empty((k, k))
        for first in range(0, k, AT_ONCE):
            part = self.dofs[first : first + AT_ONCE]
            load = np.zeros((self.pad.travel_dof, len(part)))
            load[part, np.arange(len(part))] = 1.0
            C[:, first : first + AT_ONCE] = self._factors.solve(load)[self.dofs]
        return 0.5 * (C + C.T)

    def displacements(self, force: FloatArray, travel: float) -> FloatArray:
        """All free displacements ``(free,)`` [m] under forces ``(k,)`` [N] on the front and a travel [m]."""
        load = np.zeros(self.pad.travel_dof)
        load[self.dofs] = force
        u = self._factors.solve(load)
        along = self.pad.dofs[:, 2]
        u[along[along < self.pad.travel_dof]] += travel
        return u

    def destroy(self) -> None:
        """Give the factors' memory back."""
        self._factors.destroy()
