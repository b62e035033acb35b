"""The foam of a pad: forces, stiffness and strains in terms of its unknowns."""

import numpy as np

from softjaw.fem.assembly import gather, pairs
from softjaw.fem.materials import elements, smallest_det, strains
from softjaw.fem.pad.mesh import Pad
from softjaw.friction.patch import FloatArray

SMALLEST_DET = 0.05  # a Newton step is shortened before an element is compressed further than this


class Foam:
    """Foam of a pad; vectors of unknowns are numbered as ``fem.pad.mesh.Pad`` says.

    ``rows, columns``: where the entries of `stiffness` belong, negative means fixed; ``closing_entries``: those in the
    row of the backing plate's closing displacement.
    """

    def __init__(self, pad: Pad) -> None:
        self.pad = pad
        n, nodes = pad.element_nodes.shape
        dofs = pad.dofs[pad.element_nodes].transpose(0, 2, 1)  # (n, 3, nodes)
        rows, columns = pairs(dofs[:, :, :, None, None], dofs[:, None, None, :, :])
        # the condensed plate is one dense element between all free unknowns of the back
        self._elements, behind = len(rows), pad.back_dofs if pad.back else pad.back_dofs[:0]
        self.rows = np.concatenate([rows, np.repeat(behind, len(behind))])
        self.columns = np.concatenate([columns, np.tile(behind, len(behind))])
        self.closing_entries = np.flatnonzero(self.rows == pad.closing_dof)
        self._dofs = dofs.ravel()
        self._shape = (n, 3, nodes, 3, nodes)
        # kept for all evaluations, so that an iteration allocates nothing as large
        self._r = np.empty((n, 3, nodes))
        self._none = np.empty((0, 0, 0, 0, 0))

    def force(self, x: FloatArray) -> tuple[FloatArray, float]:
        """Internal force on every unknown ``(size,)`` [N], the plate's in its closing, and the smallest ``det F``."""
        smallest = self._evaluate(x, self._none)
        R = gather(self._dofs, self._r, self.pad.size)
        if self.pad.back:
            R[self.pad.back_dofs] += self.pad.back.K @ x[self.pad.back_dofs]
        return R, smallest

    def stiffness(self, x: FloatArray, out: FloatArray) -> None:
        """Entries of the tangent [N/m] into ``out (entries,)``."""
        self._evaluate(x, out[: self._elements].reshape(self._shape))
        if self.pad.back:
            # the plate is linear: its stiffness is the same in every state
            out[self._elements :] = self.pad.back.K.ravel()

    def normal_force(self, x: FloatArray) -> float:
        """Normal force on the whole pad that the backing plate must exert at ``x`` [N]."""
        return float(self.force(x)[0][self.pad.closing_dof]) / self.pad.share

    def shorten(self, x: FloatArray, step: FloatArray, longest: float) -> float:
        """Factor that keeps the change of closing below ``longest`` [m] and ``det F`` above `SMALLEST_DET`."""
        # halving ends after 12: a step that is still wrong at 1/4096 is refused by the residual's NaN
        factor = min(1.0, longest / max(abs(step[self.pad.closing_dof]), 1e-300))
        for _ in range(12):
            if smallest_det(self._displacements(x - factor * step), self.pad.dN) > SMALLEST_DET:
                break
            factor *= 0.5
        return factor

    def strains(self, x: FloatArray, directions: FloatArray) -> tuple[float, float, float]:
        """Smallest ``det F``, largest ``|principal stretch - 1|`` and smallest eigenvalue of the acoustic tensor.

        As `fem.materials.strains` for unit ``directions (k, 3)``; the eigenvalue is divided by the shear modulus.
        """
        law = self.pad.material
        det, strain, lowest = strains(law.number, law.parameters, self._displacements(x), self.pad.dN, directions)
        return det, strain, lowest / law.shear_modulus

    def _evaluate(self, x: FloatArray, K: FloatArray) -> float:
        law, pad = self.pad.material, self.pad
        return elements(law.number, law.parameters, self._displacements(x), pad.dN, pad.volume, self._r, K)

    def _displacements(self, x: FloatArray) -> FloatArray:
        return np.ascontiguousarray(self.pad.displacement(x)[self.pad.element_nodes].transpose(0, 2, 1))
