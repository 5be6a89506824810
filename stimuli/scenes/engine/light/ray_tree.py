"""A tree of boxes around patches, so that rays find what they hit."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evenlight.method.compiled_loop import compiled_loop
from evenlight.stimuli.scenes.engine.scene import Patches

LEAF = 2  # patches at most, where they can be told apart
BINS = 16  # of the surface area heuristic
DEPTH = 64  # of the stack of a walk through the tree, which holds one node a level and is not checked
CHOSEN = DEPTH // 2  # levels that are split where it is cheapest; those below are halved, for 2^34 patches


class RayTree(NamedTuple):
    """The tree and the patches in its order (a plain tuple, as compiled code takes it).

    Attributes
    ----------
    box : array of float32, (nodes, 6)
        Lower and higher corners of the boxes [m]; what is read together lies together.
    first, many : arrays of int32, (nodes,)
        Patches of a leaf; the left child of another node, with `many` 0, and the right one next to it.
    edges : array of float32, (n, 9)
        Corner, along and across of the patches.
    triangle : array of bool, (n,)
    coverage : array of float32, (n,)
        Share of rays that a patch stops.
    patch : array of int32, (n,)
        Which patch of the scene it is.
    """

    box: NDArray[np.float32]
    first: NDArray[np.int32]
    many: NDArray[np.int32]
    edges: NDArray[np.float32]
    triangle: NDArray[np.bool_]
    coverage: NDArray[np.float32]
    patch: NDArray[np.int32]


def ray_tree(patches: Patches, coverage: NDArray[np.float64]) -> RayTree:
    """Return the tree of some patches, each with the share of rays that it stops, (n,)."""
    fourth = np.where(
        patches.triangle[:, None], patches.origin, patches.origin + patches.along + patches.across
    )
    corners = np.stack(
        [patches.origin, patches.origin + patches.along, patches.origin + patches.across, fourth]
    )
    low, high = corners.min(axis=0) - 1e-4, corners.max(axis=0) + 1e-4
    order, *nodes = _build(low, high)
    return RayTree(
        np.hstack(nodes[:2]).astype(np.float32),
        nodes[2],
        nodes[3],
        np.hstack([patches.origin, patches.along, patches.across])[order].astype(np.float32),
        patches.triangle[order],
        coverage[order].astype(np.float32),
        order.astype(np.int32),
    )


@compiled_loop(error_model="numpy")
def _build(low, high):
    """Return the order of the patches and the nodes' boxes, first entries and counts.

    However the patches lie, no walk through the tree needs a stack of more than `DEPTH`: the cheapest split
    may part off a single patch, over and over, but only on so many levels.
    """
    n = len(low)
    order = np.arange(n)
    node_low, node_high = np.empty((2 * n, 3)), np.empty((2 * n, 3))
    first, count = np.zeros(2 * n, np.int32), np.zeros(2 * n, np.int32)
    level = np.zeros(2 * n, np.int32)
    count[0] = n
    stack = [0]
    used = 1
    while len(stack) > 0:
        node = stack.pop()
        begin, many = first[node], count[node]
        for axis in range(3):
            a, b = np.inf, -np.inf
            for k in range(begin, begin + many):
                a = min(a, low[order[k], axis])
                b = max(b, high[order[k], axis])
            node_low[node, axis], node_high[node, axis] = a, b
        if many <= LEAF:
            continue
        middle = begin + many // 2
        if level[node] < CHOSEN:
            middle = _split(low, high, order, begin, many)
        first[used], count[used] = begin, middle - begin
        first[used + 1], count[used + 1] = middle, begin + many - middle
        first[node], count[node] = used, 0
        level[used] = level[used + 1] = level[node] + 1
        stack.append(used)
        stack.append(used + 1)
        used += 2
    return order, node_low[:used], node_high[:used], first[:used], count[:used]


@compiled_loop(error_model="numpy")
def _split(low, high, order, begin, many):
    """Sort patches into two groups, such that rays have least to do; return where the second begins."""
    best, best_axis, best_edge = np.inf, -1, 0.0
    for axis in range(3):
        a, b = np.inf, -np.inf
        for k in range(begin, begin + many):
            centre = low[order[k], axis] + high[order[k], axis]
            a, b = min(a, centre), max(b, centre)
        if b - a < 1e-6:
            continue
        cost, edge = _cheapest(low, high, order, begin, many, axis, a, b)
        if cost < best:
            best, best_axis, best_edge = cost, axis, edge
    if best_axis < 0:
        return begin + many // 2
    left, right = begin, begin + many - 1
    while left <= right:
        k = order[left]
        if low[k, best_axis] + high[k, best_axis] < best_edge:
            left += 1
        else:
            order[left], order[right] = order[right], k
            right -= 1
    return left if begin < left < begin + many else begin + many // 2


@compiled_loop(error_model="numpy")
def _cheapest(low, high, order, begin, many, axis, a, b):
    """Return the least cost of a split along an axis, and where it is (as twice the coordinate)."""
    box = np.empty((BINS, 6))
    box[:, :3], box[:, 3:] = np.inf, -np.inf
    counts = np.zeros(BINS, np.int64)
    for k in range(begin, begin + many):
        p = order[k]
        which = min(int(BINS * (low[p, axis] + high[p, axis] - a) / (b - a)), BINS - 1)
        counts[which] += 1
        for c in range(3):
            box[which, c] = min(box[which, c], low[p, c])
            box[which, 3 + c] = max(box[which, 3 + c], high[p, c])
    best, edge = np.inf, a
    for cut in range(1, BINS):
        cost = _cost(box[:cut], counts[:cut]) + _cost(box[cut:], counts[cut:])
        if cost < best:
            best, edge = cost, a + (b - a) * cut / BINS
    return best, edge


@compiled_loop(error_model="numpy")
def _cost(box, counts):
    """Return the surface of the box around some bins times the patches in it."""
    many = counts.sum()
    if many == 0:
        return 0.0
    size = np.empty(3)
    for c in range(3):
        size[c] = box[:, 3 + c].max() - box[:, c].min()
    return many * (size[0] * size[1] + size[1] * size[2] + size[2] * size[0])


@compiled_loop(error_model="numpy")
def _inverse(x):
    """Return 1 / x, finite."""
    return np.float32(1) / x if abs(x) > np.float32(1e-12) else np.float32(1e12)


@compiled_loop(error_model="numpy")
def _enters(box, node, ox, oy, oz, ix, iy, iz, far):
    """Return how far along a ray a node's box begins, or infinity if it is missed or beyond `far`."""
    x0, x1 = (box[node, 0] - ox) * ix, (box[node, 3] - ox) * ix
    y0, y1 = (box[node, 1] - oy) * iy, (box[node, 4] - oy) * iy
    z0, z1 = (box[node, 2] - oz) * iz, (box[node, 5] - oz) * iz
    near = max(min(x0, x1), min(y0, y1), min(z0, z1), np.float32(0))
    end = min(max(x0, x1), max(y0, y1), max(z0, z1), far)
    return near if near <= end else np.float32(np.inf)


@compiled_loop(error_model="numpy")
def _meets(edges, triangle, k, ox, oy, oz, dx, dy, dz):
    """Return distance and place (s, t) where a ray meets a patch's plane; infinity if not on the patch."""
    ax, ay, az = edges[k, 3], edges[k, 4], edges[k, 5]
    bx, by, bz = edges[k, 6], edges[k, 7], edges[k, 8]
    px, py, pz = dy * bz - dz * by, dz * bx - dx * bz, dx * by - dy * bx
    det = ax * px + ay * py + az * pz
    none = np.float32(np.inf)
    if det == 0:
        return none, none, none
    inverse = np.float32(1) / det
    cx, cy, cz = ox - edges[k, 0], oy - edges[k, 1], oz - edges[k, 2]
    s = (cx * px + cy * py + cz * pz) * inverse
    if s < 0 or s > 1:
        return none, none, none
    qx, qy, qz = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
    t = (dx * qx + dy * qy + dz * qz) * inverse
    if t < 0 or t > 1 or (triangle[k] and s + t > 1):
        return none, none, none
    return (bx * qx + by * qy + bz * qz) * inverse, s, t


@compiled_loop(error_model="numpy")
def _let_through(coverage, patch, k, ray):
    """Return whether a ray, by its number, finds a hole in a patch."""
    if coverage[k] >= 1:
        return False
    # Products of 32-bit numbers have 64 bits here: they are cut back each time.
    mixed = np.uint32(np.uint32(ray) * np.uint32(2654435761) ^ np.uint32(patch[k]) * np.uint32(2246822519))
    mixed = np.uint32((mixed ^ (mixed >> np.uint32(15))) * np.uint32(2654435769))
    return np.float32(mixed >> np.uint32(8)) / np.float32(16777216) >= coverage[k]


@compiled_loop(error_model="numpy")
def nearest(tree, ox, oy, oz, dx, dy, dz, own, ray, stack):
    """Return the entry of the first patch that a ray meets (-1 for none), with distance and place on it.

    `stack`, (2, DEPTH), is room for nodes that are still to be looked at, and where the ray enters them.
    """
    ix, iy, iz = _inverse(dx), _inverse(dy), _inverse(dz)
    far, hit = np.float32(np.inf), -1
    hit_s, hit_t = np.float32(0), np.float32(0)
    top, node = 0, 0
    while True:
        if tree.many[node] > 0:
            for k in range(tree.first[node], tree.first[node] + tree.many[node]):
                distance, s, t = _meets(tree.edges, tree.triangle, k, ox, oy, oz, dx, dy, dz)
                if (
                    0 < distance < far
                    and tree.patch[k] != own
                    and not _let_through(tree.coverage, tree.patch, k, ray)
                ):
                    far, hit, hit_s, hit_t = distance, k, s, t
        else:
            left = tree.first[node]
            a = _enters(tree.box, left, ox, oy, oz, ix, iy, iz, far)
            b = _enters(tree.box, left + 1, ox, oy, oz, ix, iy, iz, far)
            node, other = (left, left + 1) if a <= b else (left + 1, left)
            if max(a, b) < np.inf:
                stack[0, top], stack[1, top] = other, max(a, b)
                top += 1
            if min(a, b) < np.inf:
                continue
        while top > 0 and stack[1, top - 1] >= far:
            top -= 1
        if top == 0:
            return hit, far, hit_s, hit_t
        top -= 1
        node = int(stack[0, top])


@compiled_loop(error_model="numpy")
def blocker(tree, ox, oy, oz, dx, dy, dz, far, own, other, ray, guess, stack):
    """Return the entry of a patch nearer than `far` that stops a ray, other than two patches; -1 for none.

    The entry `guess` is tried first: that which stopped the ray before often stops this one.
    """
    if guess >= 0 and _stops(tree, guess, ox, oy, oz, dx, dy, dz, far, own, other, ray):
        return guess
    ix, iy, iz = _inverse(dx), _inverse(dy), _inverse(dz)
    top, node = 0, 0
    while True:
        if tree.many[node] > 0:
            for k in range(tree.first[node], tree.first[node] + tree.many[node]):
                if _stops(tree, k, ox, oy, oz, dx, dy, dz, far, own, other, ray):
                    return k
        else:
            left = tree.first[node]
            a = _enters(tree.box, left, ox, oy, oz, ix, iy, iz, far)
            b = _enters(tree.box, left + 1, ox, oy, oz, ix, iy, iz, far)
            if b < np.inf:
                stack[0, top] = left + 1
                top += 1
            if a < np.inf:
                node = left
                continue
        if top == 0:
            return -1
        top -= 1
        node = int(stack[0, top])


@compiled_loop(error_model="numpy")
def _stops(tree, k, ox, oy, oz, dx, dy, dz, far, own, other, ray):
    """Return whether an entry stops a ray before `far`."""
    distance = _meets(tree.edges, tree.triangle, k, ox, oy, oz, dx, dy, dz)[0]
    return (
        0 < distance < far
        and tree.patch[k] != own
        and tree.patch[k] != other
        and not _let_through(tree.coverage, tree.patch, k, ray)
    )
