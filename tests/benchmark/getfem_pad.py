"""A quarter of a pad on an elliptic cylinder, solved by GetFEM: closing displacements in, forces and CPU time out.

Run by ``other_code.py`` under the Python that has GetFEM: standard input has the numbers, standard output the
answer, both as JSON. Finite strains of the same foam (Blatz and Ko), no friction, gaps at the deformed place of every
quadrature point, pressures of an augmented Lagrangian on the nodes of the face, Newton's method with MUMPS.
"""

import json
import sys
import time

import getfem as gf
import numpy as np

FOAM = "G*(J*Inv(F)' - Inv(F)'*Inv(F)*Inv(F)'):Grad_Test_u"
# the cylinder lies along x with its apex at the origin; its level set is scaled to a length
PLACE = "Def F:=Id(3)+Grad_u; Def J:=Det(F); Def y:=(X(2)+u(2))/b; Def z:=(X(3)+u(3))/a-1; Def s:=sqrt(y*y+z*z);"
NORMAL = "Def w:=[0;y/b;z/a]; Def n:=w/Norm(w); Def g:=a*(s-1);"
CONTACT = "-p*(n.Test_u) + (p-pos_part(p-r*g))*Test_p/r"
ARM = "sqrt(sqr(X(1)+u(1))+sqr(X(2)+u(2)))"
BACK, ACROSS, ALONG, FACE = 1, 2, 3, 4


def solved(task):
    """Force of the whole pad [N] and mean arm of the pressure [m] at each closing displacement, and what they took."""
    length, width, thickness = task["size"]
    counts = task["elements"]
    ends = (0, length / 2), (0, width / 2), (-thickness, 0)
    sides = [np.linspace(*end, count + 1) for end, count in zip(ends, counts, strict=True)]
    gf.util_trace_level(0)
    start = time.process_time()
    mesh = gf.Mesh("cartesian", *sides)
    for region, normal in ((BACK, (0, 0, -1)), (ACROSS, (0, -1, 0)), (ALONG, (-1, 0, 0)), (FACE, (0, 0, 1))):
        mesh.set_region(region, mesh.outer_faces_with_direction(list(map(float, normal)), 0.01))
    fem_u, fem_p = gf.MeshFem(mesh, 3), gf.MeshFem(mesh, 1)
    for fem in (fem_u, fem_p):
        fem.set_fem(gf.Fem("FEM_QK(3,1)"))
    rule = gf.MeshIm(mesh, gf.Integ("IM_GAUSS_PARALLELEPIPED(3,3)"))
    model = gf.Model("real")
    model.add_fem_variable("u", fem_u)
    model.add_filtered_fem_variable("p", fem_p, FACE)
    G = task["shear_modulus"]
    for name, value in (("G", G), ("a", task["semi_axes"][0]), ("b", task["semi_axes"][1]), ("r", 4 * G / thickness)):
        model.add_initialized_data(name, [value])
    model.add_initialized_data("closing", [0.0, 0.0, 0.0])
    model.add_nonlinear_term(rule, "Def F:=Id(3)+Grad_u; Def J:=Det(F); " + FOAM)
    model.add_nonlinear_term(rule, f"{PLACE} {NORMAL} {CONTACT}", FACE)
    for region, term in ((BACK, "(u-closing).Test_u"), (ACROSS, "u(2)*Test_u(2)"), (ALONG, "u(1)*Test_u(1)")):
        model.add_nonlinear_term(rule, f"{1e6 * G / thickness}*({term})", region)
    depth = fem_u.basic_dof_nodes()[2] / -thickness
    before, forces, arms, iterations = 0.0, [], [], 0
    for closing in task["closings"]:
        moved = np.zeros(fem_u.nbdof())
        moved[2::3] = (closing - before) * depth[2::3]
        model.set_variable("u", model.variable("u") + moved)
        model.set_variable("closing", [0.0, 0.0, closing])
        goal = "max_res", 1e-9 * G * length * width, "max_iter", 60, "lsolver", "mumps"
        steps, converged = model.solve(*goal)[:2]
        if not converged:
            raise RuntimeError(f"GetFEM did not converge at a closing displacement of {1e3 * closing:g} mm")
        iterations += steps
        forces.append(-4 * gf.asm("generic", rule, 0, f"{PLACE} {NORMAL} p*n(3)", FACE, model))
        sums = [gf.asm("generic", rule, 0, f"{PLACE} {NORMAL} p*{w}", FACE, model) for w in ("1", ARM)]
        arms.append(sums[1] / sums[0])
        before = closing
    spent = time.process_time() - start
    return {"forces": forces, "arms": arms, "iterations": iterations, "unknowns": model.nbdof(), "seconds": spent}


if __name__ == "__main__":
    print(json.dumps(solved(json.load(sys.stdin))))
