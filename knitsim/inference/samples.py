"""Samples of what is known of the inputs, where the normal approximation is not enough (emcee)."""

import numpy as np

from knitsim.errors import InputError

WALKERS, STEPS, BURN = (
    64,
    3000,
    0.4,
)  # at least twice the inputs; steps each; part that is thrown away
LEAST_LENGTH = 30.0  # autocorrelation times that a chain must be long


def sampled(posterior, count=4000, seed=0, steps=STEPS):
    """(z (count, inputs), s (count,), length): samples by affine-invariant walkers (D. Foreman-Mackey et
    al., Publ. Astron. Soc. Pac. 125 (2013) 306); length: of the chains in autocorrelation times, of which
    30 or more are needed.  Equal for equal seeds.

    Raises InputError without emcee (pip install 'knitsim[samples]').
    """
    try:
        import emcee
    except ImportError:
        raise InputError("samples", "emcee", "needs pip install 'knitsim[samples]'") from None
    z, s, _ = posterior.draws(WALKERS, seed)
    start = np.column_stack([z, s])
    start = start + 1e-3 * np.random.default_rng(seed).standard_normal(start.shape)
    sampler = emcee.EnsembleSampler(WALKERS, start.shape[1], posterior.log_density, vectorize=True)
    sampler.random_state = np.random.RandomState(seed).get_state()
    sampler.run_mcmc(start, steps)
    chain = sampler.get_chain(discard=int(BURN * steps), flat=True)
    length = (
        steps
        * (1.0 - BURN)
        / float(np.max(sampler.get_autocorr_time(discard=int(BURN * steps), tol=0)))
    )
    kept = chain[np.linspace(0, len(chain) - 1, count).astype(int)]
    return kept[:, :-1], kept[:, -1], length
