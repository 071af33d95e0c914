"""Piecewise-linear tension laws, one strain at a time (compiled)."""

from knitsim.jit import njit


@njit
def segment_of(e, strain):
    """Index k of the segment strain[k] < e <= strain[k + 1]; the first and last are unbounded.

    A strain that stands twice is a jump of the tension: the jump belongs to the segment below it.
    """
    low, high = 0, strain.size - 2
    while low < high:
        middle = (low + high) // 2
        if e <= strain[middle + 1]:
            high = middle
        else:
            low = middle + 1
    return low


@njit
def slope_of(k, strain, tension):
    """Slope (N) of segment k."""
    return (tension[k + 1] - tension[k]) / (strain[k + 1] - strain[k])


@njit
def tension_at(e, strain, tension):
    """Tension (N) at the strain e; beyond the ends the first and last slope go on."""
    k = segment_of(e, strain)
    return tension[k] + slope_of(k, strain, tension) * (e - strain[k])


@njit
def stiffness_at(e, strain, tension):
    """Tangent stiffness dN/de (N) at the strain e; at a vertex that of the segment below."""
    return slope_of(segment_of(e, strain), strain, tension)


@njit
def energy_at(e, strain, tension, energy):
    """Energy per reference length (N), the integral of the tension; energy: at the vertices."""
    k = segment_of(e, strain)
    x = e - strain[k]
    return energy[k] + x * (tension[k] + 0.5 * slope_of(k, strain, tension) * x)


@njit
def fill_tension(strains, strain, tension, out):
    """tension_at of every one of ``strains`` (n,) into out (n,)."""
    for i in range(strains.size):
        out[i] = tension_at(strains[i], strain, tension)


@njit
def fill_stiffness(strains, strain, tension, out):
    """stiffness_at of every one of ``strains`` (n,) into out (n,)."""
    for i in range(strains.size):
        out[i] = stiffness_at(strains[i], strain, tension)


@njit
def fill_energy(strains, strain, tension, energy, out):
    """energy_at of every one of ``strains`` (n,) into out (n,)."""
    for i in range(strains.size):
        out[i] = energy_at(strains[i], strain, tension, energy)
