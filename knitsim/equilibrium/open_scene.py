"""The scene of open yarns for the kernels: map of the unknowns, tables, loads."""

import numpy as np

from knitsim.equilibrium import spline
from knitsim.equilibrium.cell import owners, to_map
from knitsim.equilibrium.kernels.records import (
    COUPLE,
    CYLINDER,
    IMAGE,
    LATTICE,
    ROD,
    TOUCH_POINT,
    Fixtures,
    Law,
    Scene,
    Touch,
    records,
)
from knitsim.equilibrium.model import NEIGHBOURS, rounded_law


def out_of_plane(scene, own):
    """Unknowns below ``own`` that only move points along the thickness."""
    map_ = scene.map
    row = owners(map_)
    column = map_.entries.column
    moves = (map_.entries.value != 0.0) & (row < len(map_.rows) - LATTICE)
    along = np.zeros(own, dtype=bool)
    along[[c for c in column[moves & (row % 3 == 2)] if c < own]] = True
    along[[c for c in column[moves & (row % 3 != 2)] if c < own]] = False
    return np.flatnonzero(along)


def turned(couples, part, x):
    """``part`` of the couples, their angles counted from the tangents at the control points x."""
    v = np.einsum("ma,mak->mk", couples.d1, x[couples.first[:, None] + np.arange(4)])
    v -= (v * couples.normal).sum(1)[:, None] * couples.normal
    turned = couples.copy()
    turned.moment = part * couples.moment
    turned.reference = v / np.linalg.norm(v, axis=1)[:, None]
    return turned


def assemble(yarns, cylinders, contact, diameter):
    """Scene, first control point of each yarn, columns of the supports, starting unknowns."""
    rows, start, supports, counter = [], [], {}, 0
    controls = [yarn.control() for yarn in yarns]
    chain = np.cumsum([0] + [len(c) for c in controls])[:-1]
    for k, (yarn, control) in enumerate(zip(yarns, controls, strict=True)):
        own = [None] * len(control)
        ends = {"start": (0, 1, 2, 1.0), "end": (-1, -2, -3, -1.0)}
        held = {}
        for end, (outer, middle, inner, sense) in ends.items():
            support = getattr(yarn, end)
            if support is None:
                continue
            # Place: (Q_outer + 4 Q_middle + Q_inner)/6 = P.  Direction: Q_inner - Q_outer = s t.
            t = None
            if support.kind == "clamped":
                t = support.direction
                t = sense * (control[inner] - control[outer]) if t is None else np.array(t, float)
                t = t / np.linalg.norm(t)
            held[end] = (outer, middle, inner, sense, t)
        skip = set()
        for outer, middle, _, _, t in held.values():
            skip.add(middle % len(control))
            if t is not None:
                skip.add(outer % len(control))
        for i, point in enumerate(control):
            if i not in skip:
                own[i] = [{counter + axis: 1.0} for axis in range(3)]
                start += list(point)
                counter += 3
        for end, (outer, middle, inner, sense, t) in held.items():
            if t is not None:
                along = counter
                counter += 1
                start.append(sense * (control[inner] - control[outer]) @ t)
                own[outer] = [{**own[inner][axis], along: -sense * t[axis]} for axis in range(3)]
            supports[k, end] = (own, outer, middle, inner, controls[k])
        rows.append(own)
    columns = {}
    for key, (own, outer, middle, inner, control) in supports.items():
        columns[key] = counter
        start += list((control[outer] + 4.0 * control[middle] + control[inner]) / 6.0)
        own[middle] = [
            _sum((1.5, {counter + axis: 1.0}), (-0.25, own[outer][axis]), (-0.25, own[inner][axis]))
            for axis in range(3)
        ]
        counter += 3
    map_ = to_map([row for own in rows for point in own for row in point], counter)
    y = np.array([*start, *np.zeros(LATTICE)])
    law = contact.for_kernels(diameter) if contact else Law(0.0, 0.0, 0.0, ())
    scene = Scene(
        map_,
        _rod(yarns, chain, controls),
        rounded_law(yarns[0].law),
        _touch(yarns, chain, diameter, contact is not None or bool(cylinders)),
        law,
        np.zeros(len(y)),
        np.ones(len(y)),
        (),
        Fixtures(_cylinders(cylinders), _couples(yarns, chain)),
    )
    return scene, chain, columns, y


def _sum(*terms):
    total = {}
    for factor, row in terms:
        for column, value in row.items():
            total[column] = total.get(column, 0.0) + factor * value
    return total


def _rod(yarns, chain, controls):
    parts = []
    for yarn, first, control in zip(yarns, chain, controls, strict=True):
        n = yarn.elements
        span = yarn.length / n
        place = np.tile(spline.GAUSS_POINTS, n)
        at = np.repeat(np.arange(n), 3)
        rest = np.zeros(3 * n)
        if yarn.rest_curvature is not None:
            rest = np.asarray(yarn.rest_curvature((at + place) / n), dtype=float)
        d1 = spline.basis_first(place)
        facing = np.einsum("ma,mak->mk", d1, control[at[:, None] + np.arange(4)])
        parts.append(
            records(
                ROD,
                3 * n,
                first=at + first,
                d0=spline.basis(place),
                d1=d1,
                d2=spline.basis_second(place),
                span=span,
                weight=np.tile(spline.GAUSS_WEIGHTS, n) * span,
                stiffness=yarn.bending_rigidity,
                facing=facing / np.linalg.norm(facing, axis=1)[:, None],
                turning=rest[:, None] * [0.0, 0.0, 1.0],
            )
        )
    return np.concatenate(parts).view(np.recarray)


def _touch(yarns, chain, diameter, wanted):
    parts = []
    for k, (yarn, begin) in enumerate(zip(yarns, chain, strict=True)):
        m = yarn.contacts if wanted else 0
        place = np.tile((np.arange(m) + 0.5) / max(m, 1), yarn.elements)
        at = np.repeat(np.arange(yarn.elements), m)
        step = yarn.length / yarn.elements
        parts.append(
            records(
                TOUCH_POINT,
                len(at),
                first=at + begin,
                yarn=k,
                **spline.contact_basis(place, 1.0 / max(m, 1)),
                length=step / max(m, 1),
                arc=(at + place) * step,
            )
        )
    images = records(IMAGE, 1, sign=1.0, arc_sign=1.0, turn=1)
    points = np.concatenate(parts).view(np.recarray)
    return Touch(points, images, 1.0, NEIGHBOURS * diameter, 0.0)


def _cylinders(cylinders):
    axis = np.array([c.axis for c in cylinders], dtype=float).reshape(-1, 3)
    return records(
        CYLINDER,
        len(cylinders),
        point=np.array([c.point for c in cylinders], dtype=float).reshape(-1, 3),
        axis=axis / np.linalg.norm(axis, axis=1)[:, None],
        distance=[c.distance for c in cylinders],
        stiffness=[c.stiffness for c in cylinders],
        shell=[c.law.shell(c.distance) for c in cylinders],
    )


def _couples(yarns, chain):
    turned = [k for k, yarn in enumerate(yarns) if yarn.couple]
    axis = np.array([yarns[k].couple_axis for k in turned], dtype=float).reshape(-1, 3)
    return records(
        COUPLE,
        len(turned),
        first=[chain[k] + yarns[k].elements - 1 for k in turned],
        d1=spline.basis_first([1.0]),
        moment=[yarns[k].couple for k in turned],
        normal=axis / np.linalg.norm(axis, axis=1)[:, None],
    )


def loads_of(yarns, scene, chain):
    """Dead loads by the unknowns, (2, unknowns): of the weights, of the forces at the ends."""
    force = np.zeros((2, len(scene.map.rows)))
    for yarn, first in zip(yarns, chain, strict=True):
        n = yarn.elements
        for place, load in ((0, yarn.start_force), (n, yarn.tip_force)):
            for a, part in enumerate((1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0)):
                at = 3 * (first + place + a)
                force[1, at : at + 3] += part * np.asarray(load, dtype=float)
        step = yarn.length / n
        for g, weight in zip(spline.GAUSS_POINTS, spline.GAUSS_WEIGHTS, strict=True):
            for a, part in enumerate(spline.basis([g])[0]):
                for i in range(n):
                    at = 3 * (first + i + a)
                    force[0, at : at + 3] += weight * step * part * np.asarray(yarn.weight, float)
    loads = np.zeros((2, len(scene.load)))
    entries = scene.map.entries
    for own, given in zip(loads, force, strict=True):
        np.add.at(own, entries.column, entries.value * given[owners(scene.map)])
    return loads
