"""Plain jerseys over the trade's range, none of them measured: none is refused, all but few are solved.

``jerseys.csv``: a Latin hypercube over count (Ne 10 to 60, Nm, dtex), tightness factor 11 to 18, and the
constants of dry, wet and fully relaxed fabrics, kc 4.7 to 6.0 and kw 3.6 to 4.5 (Munden 1959; Knapton et al.
1968), rounded as people state them.
"""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import knitsim as ks

TABLE = pd.read_csv(Path(__file__).parent / "jerseys.csv", dtype={"fabric": str})
TESTS = [
    ks.Pull("course", to_strain=0.2, recovery=True, states=5),
    ks.Pull("wale", to_strain=0.1, recovery=True, states=5),
]


def solved(table):
    """(dataset, how many have everything), with the refused ones asked for."""
    fabric = ks.Fabric(ks.Yarn(count_tex=20), loop_length_mm=3).with_rest(points=48)
    many = ks.sweep(fabric, table=table, tests=TESTS, progress=False, processes=1)
    reasons = [str(why) for why in many["reason"].values]
    # A refusal by a key comes before any computing: there is none.
    refused = [
        why for why in reasons if "must be" in why or "is no key" in why or "is missing" in why
    ]
    assert not refused
    force = many["force_per_width"].max("step").values
    whole = np.array([not why for why in reasons])
    assert np.isfinite(force[whole]).all() and (force[whole] > 0).all()
    # At rest a plain jersey lies where all that were measured lie, or near it.
    kc, kw = many["kc"].values[whole], many["kw"].values[whole]
    assert ((kc > 4.2) & (kc < 6.8) & (kw > 3.0) & (kw < 4.8)).all()
    return reasons, int(whole.sum())


def test_some_jerseys():
    assert solved(TABLE.iloc[::50])[1] == 4


@pytest.mark.slow
def test_two_hundred_jerseys():
    reasons, count = solved(TABLE)
    assert count >= 198, [why for why in reasons if why]
