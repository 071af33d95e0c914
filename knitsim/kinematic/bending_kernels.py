"""Pure bending of points and of a loop's length, over a whole test (compiled)."""

import math

from knitsim.jit import njit


@njit
def sinc(x):
    """sin(x)/x, and 1 at 0."""
    # The series is exact to the last bit where the quotient would divide by nothing.
    return 1.0 - x * x / 6.0 if abs(x) < 1e-4 else math.sin(x) / x


@njit
def bend_points(points, curvatures, along, out):
    """Pure bending, the corrected eqs (6)-(9): out[k] are the points (n, 3) at curvatures[k].

    With theta = kappa s along the coordinate ``along`` and x0 the thickness coordinate:
    x = -(1 - cos theta)/kappa + x0 cos theta, s' = sin theta/kappa + x0 sin theta.  Written with
    2 sin^2(theta/2)/kappa = (theta s/2) sinc^2(theta/2), nothing is lost at kappa = 0.
    """
    across = 1 - along
    for k in range(curvatures.size):
        for i in range(points.shape[0]):
            s, x0 = points[i, along], points[i, 2]
            theta = curvatures[k] * s
            half = sinc(0.5 * theta)
            out[k, i, along] = s * sinc(theta) + x0 * math.sin(theta)
            out[k, i, across] = points[i, across]
            out[k, i, 2] = x0 * math.cos(theta) - 0.5 * theta * s * half * half


@njit
def bend_points_printed(points, curvatures, along, length, out):
    """Eqs (6)-(11) as printed: the angle K' = K l/L is used as a curvature, and x0 is dropped.

    K = kappa L.  The printed positions have no dimension; they are scaled by the length L.  Not a
    number where K' = 0, as printed (0/0).
    """
    across = 1 - along
    for k in range(curvatures.size):
        for i in range(points.shape[0]):
            angle = curvatures[k] * length * (points[i, along] / length)  # K' = K l/L, (10), (11)
            out[k, i, across] = points[i, across]
            if angle == 0.0:
                out[k, i, along] = out[k, i, 2] = math.nan
            else:
                out[k, i, along] = length * math.sin(angle) / angle
                out[k, i, 2] = -length * (1.0 - math.cos(angle)) / angle


@njit
def bent_lengths(curvatures, squares, thickness, weights, out):
    """Length of the bent loop and its derivative by the curvature: out (2, steps).

    Along the bent direction a line at height x0 is stretched by 1 + kappa x0; the other two directions
    keep their length.  squares (3, n): squared derivatives along, across, thickness; thickness (n,).
    """
    for k in range(curvatures.size):
        length = slope = 0.0
        for i in range(weights.size):
            stretch = 1.0 + curvatures[k] * thickness[i]
            along2 = squares[0, i]
            speed = math.sqrt(stretch * stretch * along2 + squares[1, i] + squares[2, i])
            length += weights[i] * speed
            if speed > 0.0:
                slope += weights[i] * stretch * along2 * thickness[i] / speed
        out[0, k] = length
        out[1, k] = slope


@njit
def bend_frames(points, tangents, frame, curvatures, along, normals, binormals):
    """Frames of the bent sections: normals, binormals (steps, n, 3).

    The fabric's bending turns a section at coordinate s by theta = kappa s about the cylinder's axis
    and stretches it along the bent direction by 1 + kappa x0; the flat normal ``frame`` (n, 3) is
    turned with it and set upright on the bent tangent.  So the frames of the next loop are these,
    turned about the cylinder's axis.
    """
    across = 1 - along
    t, m = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
    for k in range(curvatures.size):
        for i in range(points.shape[0]):
            theta = curvatures[k] * points[i, along]
            c, s = math.cos(theta), math.sin(theta)
            stretched = tangents[i, along] * (1.0 + curvatures[k] * points[i, 2])
            t[along] = c * stretched + s * tangents[i, 2]
            t[across] = tangents[i, across]
            t[2] = c * tangents[i, 2] - s * stretched
            m[along] = c * frame[i, along] + s * frame[i, 2]
            m[across] = frame[i, across]
            m[2] = c * frame[i, 2] - s * frame[i, along]
            scale = 1.0 / math.sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2])
            dot = 0.0
            for j in range(3):
                t[j] *= scale
                dot += t[j] * m[j]
            for j in range(3):
                m[j] -= dot * t[j]
            scale = 1.0 / math.sqrt(m[0] * m[0] + m[1] * m[1] + m[2] * m[2])
            for j in range(3):
                m[j] *= scale
                normals[k, i, j] = m[j]
            binormals[k, i, 0] = t[1] * m[2] - t[2] * m[1]
            binormals[k, i, 1] = t[2] * m[0] - t[0] * m[2]
            binormals[k, i, 2] = t[0] * m[1] - t[1] * m[0]
