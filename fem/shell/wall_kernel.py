"""Compiled loop over the points of a pad that press on a deformable wall.

At a point with the pressure ``p = sum N_i lam_i`` and the traction ``t`` of friction, the pad's node ``b`` gets
``-N_b (p n + t) dA`` and the wall's node ``a`` gets ``N_a (p n + t) dA``; the weighted gap of a contact node is
``int N_i g dA``. Points that face no wall are left out of both, so that a pad over a rim is carried up to the rim.
Derivatives are those of ``facing``. Pad quantities are in the pad's frame, ``x_object = R x_pad + origin``; the wall's
in the object's.

A node of the wall has unknowns ``first``, the displacement of the middle, and ``second``, the change of the director:
both move the outer face, and so the same force works on both.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from softjaw.fem.shell.facing import FAR


@njit(cache=True)
def contact_tangent(N, area, lam, active, kappa, gap, normal, e, nodes, wall_N, H, G, S, held, traction, by_motion,
                    by_normal, by_pressure, old_nodes, old_N, R, pad_dofs, pressures, first, second, start, column,
                    values):  # fmt: skip
    """Add one pad's entries of the tangent to the compressed rows; whether all of them had a place.

    ``active (faces, k)``: whether a node's complementarity row is its gap; ``kappa``: scale of pressures, ``lam /
    kappa`` are the unknowns and ``kappa int N_i g dA`` the rows [Pa/m]; ``e, H, G, S``: as in `Facing`; ``held (n,)``:
    points whose traction counts, with its derivatives, ``old_nodes, old_N`` where they stuck to the wall; ``pad_dofs
    (faces, 3, k)``, ``pressures (faces, k)``, ``first, second (wall nodes, 3)``: unknowns of the whole problem, -1
    where fixed.
    """
    points, k = N.shape
    t = 3 * k  # local order: pad (component, node), wall first (node, component), wall second, pressures, old places
    u, old = t + 24, t + 24 + k
    M, dof = np.empty((t + 12, old + 24)), np.empty(old + 24, np.int64)
    D = np.empty((3, u))  # change of the point relative to the wall, as far as it turns and slides what it faces
    dn, change, force, row = np.empty((3, u)), np.empty((3, old + 24)), np.empty(3), np.empty(u)
    complete = True
    for f in range(area.shape[0]):
        engaged = False
        for i in range(k):
            # facets that neither press nor are about to have no couplings, and most have none
            engaged = engaged or active[f, i] or lam[f, i] != 0.0
        if not engaged:
            continue
        for q in range(points):
            m = f * points + q
            if gap[m] == FAR:
                continue
            p = 0.0
            for i in range(k):
                p += N[q, i] * lam[f, i]
            changes(N[q], gap[m], wall_N[m], H[m], G[m], R, D, dn)
            number(pad_dofs[f], pressures[f], first, second, nodes[m], dof)
            for d in range(3):
                force[d] = p * normal[m, d]
                for j in range(u):
                    change[d, j] = p * dn[d, j]
                for i in range(k):
                    change[d, u + i] = kappa * N[q, i] * normal[m, d]
            if held[m]:
                for d in range(3):
                    force[d] += traction[m, d]
                    for c in range(3):
                        for j in range(u):
                            change[d, j] += by_normal[m, d, c] * dn[c, j]
                        for j in range(t):
                            change[d, j] += by_motion[m, d, c] * D[c, j]
                        for a in range(4):
                            dragged = -old_N[m, a] * by_motion[m, d, c]
                            change[d, old + 3 * a + c] = change[d, old + 12 + 3 * a + c] = dragged
                    for i in range(k):
                        change[d, u + i] += kappa * N[q, i] * by_pressure[m, d]
                for a in range(4):
                    for c in range(3):
                        dof[old + 3 * a + c] = first[old_nodes[m, a], c]
                        dof[old + 12 + 3 * a + c] = second[old_nodes[m, a], c]
            w, columns = area[f, q], old + 24 if held[m] else old
            for j in range(columns):
                for c in range(3):
                    pull = R[0, c] * change[0, j] + R[1, c] * change[1, j] + R[2, c] * change[2, j]
                    for b in range(k):
                        M[c * k + b, j] = -w * N[q, b] * pull
                for a in range(4):
                    slide = S[m, a, 0] * D[0, j] + S[m, a, 1] * D[1, j] + S[m, a, 2] * D[2, j] if j < u else 0.0
                    for c in range(3):
                        M[t + 3 * a + c, j] = w * (wall_N[m, a] * change[c, j] + slide * force[c])
            for r in range(u):
                if dof[r] >= 0:
                    # what moves the outer face carries the same force
                    local = r if r < t + 12 else r - 12
                    complete &= add_row(dof[r], M[local, :columns], dof, start, column, values)
            for i in range(k):
                if active[f, i]:
                    for j in range(u):
                        row[j] = kappa * w * N[q, i] * (e[m, 0] * D[0, j] + e[m, 1] * D[1, j] + e[m, 2] * D[2, j])
                    complete &= add_row(pressures[f, i], row, dof, start, column, values)
    return complete


@njit(cache=True)
def number(pad_dofs, pressures, first, second, nodes, dof):
    """Write to ``dof`` the unknowns of a pad's face, of the wall's nodes that a point faces, and of the pressures."""
    k = pressures.size
    t = 3 * k
    for i in range(k):
        dof[t + 24 + i] = pressures[i]
        for c in range(3):
            dof[c * k + i] = pad_dofs[c, i]
    for a in range(4):
        for c in range(3):
            dof[t + 3 * a + c] = first[nodes[a], c]
            dof[t + 12 + 3 * a + c] = second[nodes[a], c]


@njit(cache=True)
def add_row(row, entries, dof, start, column, values):
    """Add entries in the columns ``dof``, -1 where fixed, to a compressed row; whether all of them had a place."""
    complete = True
    low, high = start[row], start[row + 1]
    for j in range(entries.size):
        if dof[j] < 0:
            continue
        # columns ascend within a row, so bisection finds the slot; if none, the caller grows the pattern
        place = low + np.searchsorted(column[low:high], dof[j])
        if place == high or column[place] != dof[j]:
            complete = False
        else:
            values[place] += entries[j]
    return complete


@njit(cache=True)
def changes(N, gap, wall_N, H, G, R, D, dn):
    """Changes with every local unknown: position relative to the wall ``D (3, t + 24)`` and normal ``dn``."""
    k = N.size
    t = 3 * k
    for c in range(3):
        for b in range(k):
            for d in range(3):
                D[d, c * k + b] = R[d, c] * N[b]
    for a in range(4):
        for c in range(3):
            for d in range(3):
                D[d, t + 3 * a + c] = -wall_N[a] if c == d else 0.0
                D[d, t + 12 + 3 * a + c] = D[d, t + 3 * a + c] - gap * wall_N[a] * G[d, c]
    for j in range(t + 24):
        for d in range(3):
            dn[d, j] = H[d, 0] * D[0, j] + H[d, 1] * D[1, j] + H[d, 2] * D[2, j]
    for b in range(4):
        for c in range(3):
            for d in range(3):
                dn[d, t + 12 + 3 * b + c] += wall_N[b] * G[d, c]
