"""Forces and stiffness of the foam of one pad, element by element, and of the elastic sheet behind it, if there is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.pad import hexahedra as kernel
from softjaw.fem.pad.mesh import Pad

FloatArray = NDArray[np.float64]
SMALLEST_DET = 0.05  # a Newton step is shortened before an element is squeezed further than this


class Foam:
    """Foam of a pad; vectors of unknowns are numbered as ``fem.pad.mesh.Pad`` says.

    Attributes
    ----------
    rows, columns : (entries,) arrays
        Where the entries of `stiffness` belong; negative means fixed.
    travel_entries : (k,) array
        Those of them in the row of the sheet's travel.
    """

    def __init__(self, pad: Pad) -> None:
        self.pad = pad
        n, nodes = pad.element_nodes.shape
        dofs = pad.dofs[pad.element_nodes].transpose(0, 2, 1)  # (n, 3, nodes)
        pair = np.broadcast_arrays(dofs[:, :, :, None, None], dofs[:, None, None, :, :])
        rows, columns = (index.ravel().astype(np.int32) for index in pair)
        self._elements, behind = len(rows), pad.back_dofs if pad.back else pad.back_dofs[:0]
        self.rows = np.concatenate([rows, np.repeat(behind, len(behind))])
        self.columns = np.concatenate([columns, np.tile(behind, len(behind))])
        self.travel_entries = np.flatnonzero(self.rows == pad.travel_dof)
        self._dofs = dofs.ravel()
        self._shape = (n, 3, nodes, 3, nodes)
        self._r = np.empty((n, 3, nodes))
        self._none = np.empty((0, 0, 0, 0, 0))

    def force(self, x: FloatArray) -> tuple[FloatArray, float]:
        """Internal force on every unknown ``(size,)`` [N], the sheet's in its travel, and the smallest ``det F``."""
        smallest = self._evaluate(x, self._none)
        R = gather(self._dofs, self._r, self.pad.size)
        if self.pad.back:
            R[self.pad.back_dofs] += self.pad.back.K @ x[self.pad.back_dofs]
        return R, smallest

    def stiffness(self, x: FloatArray, out: FloatArray) -> None:
        """Entries of the tangent [N/m] into ``out (entries,)``."""
        self._evaluate(x, out[: self._elements].reshape(self._shape))
        if self.pad.back:
            out[self._elements :] = self.pad.back.K.ravel()

    def sheet_force(self, x: FloatArray) -> float:
        """Normal force on the whole pad that the sheet must exert at ``x`` [N]."""
        return float(self.force(x)[0][self.pad.travel_dof]) / self.pad.share

    def shorten(self, x: FloatArray, step: FloatArray, longest: float) -> float:
        """Factor that keeps the change of travel below ``longest`` [m] and the squeezing of elements within reason."""
        factor = min(1.0, longest / max(abs(step[self.pad.travel_dof]), 1e-300))
        for _ in range(12):
            if kernel.smallest_det(self._displacements(x - factor * step), self.pad.dN) > SMALLEST_DET:
                break
            factor *= 0.5
        return factor

    def strains(self, x: FloatArray, directions: FloatArray) -> tuple[float, float, float]:
        """Smallest ``det F``, largest principal strain and smallest scaled eigenvalue of the acoustic tensor."""
        u, dN, law = self._displacements(x), self.pad.dN, self.pad.material
        strain, acoustic = kernel.strain_measures(law.number, law.parameters, law.shear_modulus, u, dN, directions)
        return kernel.smallest_det(u, dN), strain, acoustic

    def _evaluate(self, x: FloatArray, K: FloatArray) -> float:
        law, pad = self.pad.material, self.pad
        return kernel.elements(law.number, law.parameters, self._displacements(x), pad.dN, pad.volume, self._r, K)

    def _displacements(self, x: FloatArray) -> FloatArray:
        return np.ascontiguousarray(self.pad.displacement(x)[self.pad.element_nodes].transpose(0, 2, 1))


def gather(dofs: NDArray[np.int32], values: FloatArray, size: int) -> FloatArray:
    """Sum element values into a vector; fixed unknowns (index -1) fall off the front."""
    return np.bincount(dofs.ravel() + 1, values.ravel(), size + 1)[1:]
