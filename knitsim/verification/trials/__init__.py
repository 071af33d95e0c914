"""Random fabrics and tests for the equilibrium model: how they are drawn, which can exist, how solved.

:mod:`.law` draws them, :mod:`.rule` says which are possible, :mod:`.table` has one row for each
campaign; all three stand before a campaign is run and know nothing of the solver.  :mod:`.told` tells
the judge of a result, :mod:`.run` solves a case and has it judged.
"""
