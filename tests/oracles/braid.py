"""The braid of a loose open trefoil knot, from beam theory alone: what Coulomb's friction adds to the pull.

Audoly, Clauvelin and Neukirch (Phys. Rev. Lett. 99, 164301, 2007): a rod of radius h and bending rigidity B
with a loose open trefoil knot is held by F h^2/B = e^4/2 + mu s e^3, e = sqrt(h/R) small, R the radius of
the loop, s = 0.492.

Derived here.  Two strands lie along x in the braid; r = (y, z) is the distance between their axes over h,
xi = x/sqrt(h R).  The sum of the two is free of contact; the difference obeys r'''' = 2 p n where it
touches, |r| = 2, n = r/|r|, with p in units of B h/(h R)^2.  Either strand leaves the braid at one end into
the loop, with the curvature 1/R, and at the other into a straight tail; so y'' = -1 and 1 at the two ends,
z'' = 0, no forces: r makes (1/4) int |r''|^2 - (y'(-l) + y'(l))/2 least among those with |r| >= 2 that turn
by three half turns.  When the knot tightens by the way X of an end, the strands rub along each other by X
under the force int p, so that s = int p dxi.
"""

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

TURNS, CORE = 3, 2.6  # half turns; where a start has them


def braid(reach=6.0, nodes=301, hardness=1e3):
    """Places xi (nodes,), r (nodes, 2) and pressure p (nodes,); hardness: of the contact, a penalty."""
    x = np.linspace(-reach, reach, nodes)
    step = x[1] - x[0]
    turned = -0.5 * np.pi + TURNS * np.pi * np.clip((x + CORE) / (2.0 * CORE), 0.0, 1.0)
    radius = 2.2 + 0.5 * np.maximum(np.abs(x) - CORE, 0.0) ** 2
    r = radius * np.stack([np.sin(turned), np.cos(turned)])
    second = sparse.diags([1.0, -2.0, 1.0], [0, 1, 2], shape=(nodes - 2, nodes)) / step**2
    bending = 0.5 * step * (second.T @ second)
    moments = np.zeros((2, nodes))
    moments[0, [0, -2]], moments[0, [1, -1]] = -0.5 / step, 0.5 / step
    # Rigid motions that cost nothing are held by next to nothing.
    held = 1e-6 * step * sparse.identity(nodes)
    for hard in np.geomspace(10.0, hardness, 3):
        for trial in range(400):
            distance = np.linalg.norm(r, axis=0)
            n, p = r / distance, hard * np.maximum(2.0 - distance, 0.0)
            gradient = (bending @ r.T).T - moments - step * p * n
            stiff = step * hard * (p > 0.0)
            # What turning a push does would not be definite far from the end; near it, it is needed.
            geometric = step * p / distance * (trial > 20)
            yy, zz, yz = (
                stiff * n[i] * n[j] - geometric * ((i == j) - n[i] * n[j])
                for i, j in ((0, 0), (1, 1), (0, 1))
            )
            mixed = sparse.diags(yz)
            hessian = sparse.bmat(
                [[bending + held + sparse.diags(yy), mixed],
                 [mixed, bending + held + sparse.diags(zz)]], format="csc",
            )  # fmt: skip
            change = spsolve(hessian, -gradient.ravel()).reshape(2, nodes)
            largest = np.abs(change).max()
            r = r + min(1.0, 0.3 / largest) * change
            if largest < 1e-8:
                break
    distance = np.linalg.norm(r, axis=0)
    return x, r.T, hard * np.maximum(2.0 - distance, 0.0)


def friction_of_braid():
    """s: int p dxi."""
    x, _, p = braid()
    return float(p.sum() * (x[1] - x[0]))


def next_of_pull():
    """Of e, in F h^2/B = (e^4/2)(1 + it e + ...) without friction.

    Bending energy of the braid and what the loop turns by more than a whole turn come to G B e/R, with G the
    least value of the functional above plus l/2.  At 2 pi R = rod length less distance of the ends, F is
    the derivative of pi B/R + G B h^(1/2) R^(-3/2) by that distance.
    """
    x, r, _ = braid()
    step = x[1] - x[0]
    bent = 0.25 * step * ((np.diff(r, 2, axis=0) / step**2) ** 2).sum()
    slopes = (r[-1, 0] - r[-2, 0] + r[1, 0] - r[0, 0]) / step
    return 3.0 / (2.0 * np.pi) * (bent - 0.5 * slopes + 0.5 * x[-1])
