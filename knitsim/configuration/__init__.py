"""Yarns, fabrics and scenes as data: reading, checking, SI values, sweeps and assumptions.

:func:`knitsim.configuration.study.load_study` is the way in.  Nothing here imports numpy, because
the Snakefile calls it at every start.
"""
