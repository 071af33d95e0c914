"""The judge: is a result of the equilibrium model right?  Shares nothing with the solver.

:mod:`.measure` has the energies of a shape by any quadrature, :mod:`.shape` its crossings and closest
approach, :mod:`.verdict` what is compared with what, and the limits.
"""
