"""Compiled loop over the points of a pad that press on a deformable wall.

At a point with the pressure ``p = sum N_i lam_i`` the pad's node ``b`` gets ``-p dA N_b n`` and the wall's node ``a``
gets ``p dA N_a n``; the weighted gap of a contact node is ``int N_i g dA``. Points that face no wall are left out of
both, so that a pad over a rim is carried up to the rim. Derivatives are those of ``facing``. Pad quantities are in the
pad's frame, ``x_object = R x_pad + origin``; the wall's in the object's.

A node of the wall has unknowns ``first``, the displacement of the middle, and ``second``, the change of the director:
both move the outer face, and so the same force works on both.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from softjaw.fem.shell.facing import FAR


@njit(cache=True)
def contact_tangent(N, area, lam, active, kappa, gap, normal, e, wall_nodes, wall_N, H, G, A, R, pad_dofs, pressures,
                    first, second, start, column, values):  # fmt: skip
    """Add one pad's entries of the tangent to the compressed rows; whether all of them had a place.

    ``active (faces, k)``: whether a node's complementarity row is its gap; ``kappa``: scale of pressures, ``lam /
    kappa`` are the unknowns and ``kappa int N_i g dA`` the rows [Pa/m]; ``e, H, G, A``: as in `Facing`; ``pad_dofs
    (faces, 3, k)``, ``pressures (faces, k)``, ``first, second (wall nodes, 3)``: unknowns of the whole problem, -1
    where fixed.
    """
    points, k = N.shape
    t = 3 * k  # local order of unknowns: pad (component, node), wall first (node, component), wall second, pressures
    M = np.zeros((t + 12 + k, t + 24 + k))
    dof = np.empty(t + 24 + k, np.int64)
    D = np.empty((3, t + 24))  # change of the point relative to the wall, as far as it turns and slides what it faces
    dn, dA = np.empty((3, t + 24)), np.empty((4, 3, t + 24))
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
            changes(N[q], gap[m], wall_nodes[m], wall_N[m], H[m], G[m], A[m], R, D, dn, dA)
            w = area[f, q]
            for j in range(t + 24):
                for c in range(3):
                    turned = R[0, c] * dn[0, j] + R[1, c] * dn[1, j] + R[2, c] * dn[2, j]
                    for b in range(k):
                        M[c * k + b, j] = -p * w * N[q, b] * turned
                for a in range(4):
                    for c in range(3):
                        M[t + 3 * a + c, j] = p * w * dA[a, c, j]
                slope = e[m, 0] * D[0, j] + e[m, 1] * D[1, j] + e[m, 2] * D[2, j]
                for i in range(k):
                    M[t + 12 + i, j] = kappa * w * N[q, i] * slope if active[f, i] else 0.0
            for i in range(k):
                for c in range(3):
                    n_c = normal[m, 0] * R[0, c] + normal[m, 1] * R[1, c] + normal[m, 2] * R[2, c]
                    for b in range(k):
                        M[c * k + b, t + 24 + i] = -kappa * w * N[q, i] * N[q, b] * n_c
                for a in range(4):
                    for c in range(3):
                        M[t + 3 * a + c, t + 24 + i] = kappa * w * N[q, i] * wall_N[m, a] * normal[m, c]
            number(pad_dofs[f], pressures[f], first, second, wall_nodes[m], dof)
            for r in range(t + 24 + k):
                if dof[r] < 0:
                    continue
                # what moves the outer face carries the same force
                local = r if r < t + 12 else r - 12
                gap_row = r >= t + 24
                if gap_row and not active[f, r - t - 24]:
                    continue
                columns = t + 24 + (0 if gap_row else k)
                complete &= add_row(dof[r], M[local, :columns], dof, start, column, values)
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
def changes(N, gap, nodes, wall_N, H, G, A, R, D, dn, dA):
    """Changes with every local unknown: relative position ``D``, normal ``dn`` and nodal shares ``dA = d(N_a n)``."""
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
            for a in range(4):
                dA[a, d, j] = A[a, d, 0] * D[0, j] + A[a, d, 1] * D[1, j] + A[a, d, 2] * D[2, j]
    for b in range(4):
        for c in range(3):
            j = t + 12 + 3 * b + c
            for d in range(3):
                dn[d, j] += wall_N[b] * G[d, c]
                for a in range(4):
                    dA[a, d, j] += wall_N[a] * wall_N[b] * G[d, c]


@njit(cache=True)
def friction_tangent(N, area, held, traction, by_motion, by_normal, by_pressure, kappa, gap, normal, nodes, wall_N, H,
                      G, A, old_nodes, old_N, R, pad_dofs, pressures, first, second, start, column,
                      values):  # fmt: skip
    """Add what friction on one pad adds to the tangent; whether all entries had a place.

    As `contact_tangent`; ``held (n,)`` are points whose traction counts, ``old_nodes, old_N`` where they stuck to the
    wall.
    """
    points, k = N.shape
    t = 3 * k  # local order: pad (component, node), wall first, wall second, pressures, old place first, second
    old = t + 24 + k
    M, change = np.empty((t + 12, t + 48 + k)), np.empty((3, t + 48 + k))
    dof = np.empty(t + 48 + k, np.int64)
    D, dn, dA = np.empty((3, t + 24)), np.empty((3, t + 24)), np.empty((4, 3, t + 24))
    complete = True
    for m in range(held.size):
        if not held[m]:
            continue
        f, q = m // points, m % points
        changes(N[q], gap[m], nodes[m], wall_N[m], H[m], G[m], A[m], R, D, dn, dA)
        change[:] = 0.0
        for d in range(3):
            for j in range(t + 24):
                for c in range(3):
                    change[d, j] += by_normal[m, d, c] * dn[c, j]
                    if j < t:
                        change[d, j] += by_motion[m, d, c] * D[c, j]
            for a in range(4):
                for c in range(3):
                    dragged = -old_N[m, a] * by_motion[m, d, c]
                    change[d, old + 3 * a + c] = change[d, old + 12 + 3 * a + c] = dragged
            for i in range(k):
                change[d, t + 24 + i] = kappa * N[q, i] * by_pressure[m, d]
        w = area[f, q]
        for j in range(t + 48 + k):
            for c in range(3):
                pull = R[0, c] * change[0, j] + R[1, c] * change[1, j] + R[2, c] * change[2, j]
                for b in range(k):
                    M[c * k + b, j] = -w * N[q, b] * pull
            for a in range(4):
                share = 0.0
                if j < t + 24:
                    for c in range(3):
                        share += normal[m, c] * dA[a, c, j]
                for c in range(3):
                    M[t + 3 * a + c, j] = w * (wall_N[m, a] * change[c, j] + share * traction[m, c])
        number(pad_dofs[f], pressures[f], first, second, nodes[m], dof)
        for a in range(4):
            for c in range(3):
                dof[old + 3 * a + c] = first[old_nodes[m, a], c]
                dof[old + 12 + 3 * a + c] = second[old_nodes[m, a], c]
        for r in range(t + 24):
            if dof[r] < 0:
                continue
            # what moves the outer face carries the same force
            local = r if r < t + 12 else r - 12
            complete &= add_row(dof[r], M[local], dof, start, column, values)
    return complete
