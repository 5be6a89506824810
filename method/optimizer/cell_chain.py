"""The cheapest way through a chain of cells: a global minimum that rounds the safe way.

The factor's range is cut into cells. Frames are taken in blocks of a few, short enough that the rate limit
lets the factor move but little within one: the frame in a block's middle is its anchor. A chain goes from
anchor to anchor, and a step between two cells is allowed if any two factors in them may follow each other.
What the other frames of a block cost is the cost at the anchor's factor, less the most that they could save
by as much as they may move away from it. So the cells need to be fine against the change within a block, not
within a frame: time and tightness per frame do not depend on how many frames there are.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evenlight.data_schema.arrays import Array, Integers
from evenlight.method.compiled_loop import compiled_loop


class RateTable(NamedTuple):
    """An upper envelope of the rate limit over luminance, looked up by logarithm."""

    # (B,): the largest rate limit from the start of a bin to a segment's width above it [cd/m^2/s]
    highest: Array
    place: Array  # (N,): bin of each frame at factor 1, with its fraction; far below 0 for a black frame
    offset: Array  # (K-1,): bins from there to the lower end of each segment


class FrameBlocks(NamedTuple):
    """The frames in blocks."""

    start: Integers  # (M+1,): first frame of each block, and N
    anchor: Integers  # (M,): its middle frame
    spread: Integers  # (M,): segments that the factor may cross from one anchor to the next, at most


class ChainCosts(NamedTuple):
    """What each frame costs, linear between the knots of the loss curves."""

    loss: Array  # (N, K): loss curves
    weights: Array  # (N,): how much each frame's loss costs
    share: Array  # (N,): of each frame's factor in the budget
    price: float  # of the budget
    knots: Array  # (K,): factors of the knots


@compiled_loop(error_model="numpy")
def make_blocks(largest_step: Array, target: float, narrowest: float) -> tuple[Integers, Integers, Integers]:
    """Return blocks within which the factor can move by a target at most; see `FrameBlocks`.

    Parameters
    ----------
    largest_step : array, (N-1,)
        The largest change of the factor from each frame to the next.
    target : float
        Most that the factor may move within a block of more than one frame.
    narrowest : float
        Width of the narrowest segment.
    """
    n = len(largest_step) + 1
    start, blocks, moved = np.empty(n + 1, np.int64), 0, 0.0
    start[0] = 0
    for i in range(1, n):
        moved += largest_step[i - 1]
        if moved > target:
            blocks, moved = blocks + 1, 0.0
            start[blocks] = i
    blocks += 1
    start[blocks] = n
    start = start[: blocks + 1].copy()
    anchor = (start[:-1] + start[1:] - 1) // 2
    spread = np.empty(blocks, np.int64)
    for k in range(blocks):
        end = anchor[k + 1] if k + 1 < blocks else n - 1
        onwards = largest_step[anchor[k] : end].sum()
        within = largest_step[start[k] : start[k + 1] - 1].sum()
        spread[k] = int(min(np.ceil(max(onwards, within) / narrowest), 1e6))
    return start, anchor, spread


@compiled_loop(error_model="numpy")
def cheapest_chain(
    costs: ChainCosts, rates: RateTable, reach: Array, blocks: FrameBlocks, per_knot: int
) -> tuple[float, float]:
    """Return the least Σ weights · loss + price · share · factor over all chains of cells.

    Parameters
    ----------
    costs : ChainCosts
        Of the frames.
    rates : RateTable
        Of the rate limit.
    reach : array, (N-1,)
        Change of the factor per rate; infinite where a step is free.
    blocks : FrameBlocks
        Of the frames.
    per_knot : int
        Cells between two knots.

    Returns
    -------
    least, used : float
        That sum, and Σ share · factor of the chain that has it: how the sum changes with the price.
    """
    segments = len(costs.knots) - 1
    cells = segments * per_knot
    edges = _edges(costs.knots, per_knot)
    value, following = np.zeros(cells), np.empty(cells)
    used, used_next = np.zeros(cells), np.empty(cells)
    lowest, highest = np.zeros(cells, np.int64), np.full(cells, cells - 1, np.int64)
    first, second = np.empty(cells), np.empty(cells)
    cost, use = np.empty(cells), np.empty(cells)
    queue = np.empty(cells, np.int64)
    for k in range(len(blocks.anchor)):
        _cell_costs(cost, use, costs, _block_costs(costs, rates, reach, blocks, k), per_knot)
        if k > 0:
            if _reach_between(first, second, rates, reach, blocks, k - 1, per_knot):
                _windows(lowest, highest, edges, first, second)
            else:
                lowest[:], highest[:] = 0, cells - 1
        head, tail, entering = 0, 0, 0
        for cell in range(cells):
            while entering < cells and lowest[entering] <= cell:
                while tail > head and value[queue[tail - 1]] >= value[entering]:
                    tail -= 1
                queue[tail] = entering
                tail += 1
                entering += 1
            while highest[queue[head]] < cell:
                head += 1
            before = queue[head]
            following[cell] = value[before] + cost[cell]
            used_next[cell] = used[before] + use[cell]
        value, following = following, value
        used, used_next = used_next, used
    end = int(np.argmin(value))
    return value[end], used[end]


@compiled_loop(error_model="numpy")
def _edges(knots: Array, per_knot: int) -> Array:
    edges = np.empty((len(knots) - 1) * per_knot + 1)
    for segment in range(len(knots) - 1):
        for k in range(per_knot):
            share = k / per_knot
            edges[segment * per_knot + k] = knots[segment] * (1 - share) + knots[segment + 1] * share
    edges[-1] = knots[-1]
    return edges


@compiled_loop(error_model="numpy")
def _highest_rates(row: Array, rates: RateTable, frame: int, spread: int) -> None:
    """Write the largest rate limit within each segment and some to either side of it, for a frame."""
    last, end = len(rates.highest) - 1, len(row) - 1
    for segment in range(len(row)):
        place = rates.place[frame] + rates.offset[segment]
        row[segment] = rates.highest[min(max(int(np.floor(place)), 0), last)]
    if spread > 0:
        narrow = row.copy()
        for segment in range(len(row)):
            for other in range(max(segment - spread, 0), min(segment + spread, end) + 1):
                row[segment] = max(row[segment], narrow[other])


@compiled_loop(error_model="numpy")
def _reach_between(
    first: Array, second: Array, rates: RateTable, reach: Array, blocks: FrameBlocks, k: int, per_knot: int
) -> bool:
    """Write how far an anchor's factor may lie from the next one's, by either's cell; False if anywhere."""
    begin, end = blocks.anchor[k], blocks.anchor[k + 1]
    for step in range(begin, end):
        if np.isinf(reach[step]):
            return False
    segments = len(rates.offset)
    row, row_next = np.empty(segments), np.empty(segments)
    if end == begin + 1:  # nothing between: each end of the step has its own limit
        _highest_rates(row, rates, begin, 0)
        _highest_rates(row_next, rates, end, 0)
        row *= reach[begin]
        row_next *= reach[begin]
    else:
        sum_of_steps = np.zeros(segments)
        _highest_rates(row, rates, begin, blocks.spread[k])
        for step in range(begin, end):
            _highest_rates(row_next, rates, step + 1, blocks.spread[k])
            sum_of_steps += reach[step] * np.minimum(row, row_next)
            row, row_next = row_next, row
        row[:], row_next[:] = sum_of_steps, sum_of_steps
    for cell in range(len(first)):
        first[cell], second[cell] = row[cell // per_knot], row_next[cell // per_knot]
    return True


@compiled_loop(error_model="numpy")
def _block_costs(
    costs: ChainCosts, rates: RateTable, reach: Array, blocks: FrameBlocks, k: int
) -> tuple[Array, float, Array]:
    """Return a block's summed costs at each knot, its share in the budget, and what moving may save.

    The last is by segment: how far each frame's factor may be from the anchor's, times its steepest cost.
    """
    begin, end, anchor = blocks.start[k], blocks.start[k + 1], blocks.anchor[k]
    at_knot, share = np.zeros(len(costs.knots)), 0.0
    for frame in range(begin, end):
        share += costs.share[frame]
        for knot in range(len(at_knot)):
            at_knot[knot] += costs.weights[frame] * costs.loss[frame, knot]
    segments = len(at_knot) - 1
    saved = np.zeros(segments)
    row, row_next, away = np.empty(segments), np.empty(segments), np.empty(segments)
    for onwards in (1, -1):
        away[:] = 0.0
        last = end - 1 if onwards > 0 else begin
        if anchor == last:
            continue
        _highest_rates(row, rates, anchor, blocks.spread[k])
        frame = anchor
        while frame != last:
            step = frame if onwards > 0 else frame - 1
            frame += onwards
            _highest_rates(row_next, rates, frame, blocks.spread[k])
            away += reach[step] * np.minimum(row, row_next)
            row, row_next = row_next, row
            _add_savings(saved, costs, frame, away, blocks.spread[k])
    return at_knot, share, saved


@compiled_loop(error_model="numpy")
def _add_savings(saved: Array, costs: ChainCosts, frame: int, away: Array, spread: int) -> None:
    """Add what a frame may save by being away from its block's anchor."""
    segments = len(saved)
    steep = np.empty(segments)
    for segment in range(segments):
        rise = costs.loss[frame, segment + 1] - costs.loss[frame, segment]
        slope = costs.weights[frame] * rise / (costs.knots[segment + 1] - costs.knots[segment])
        steep[segment] = abs(slope + costs.price * costs.share[frame])
    for segment in range(segments):
        most = 0.0
        for other in range(max(segment - spread, 0), min(segment + spread, segments - 1) + 1):
            most = max(most, steep[other])
        saved[segment] += away[segment] * most


@compiled_loop(error_model="numpy")
def _cell_costs(
    cost: Array, use: Array, costs: ChainCosts, block: tuple[Array, float, Array], per_knot: int
) -> None:
    """Write the least cost within each cell, at an edge since it is linear, and the budget used there."""
    at_knot, share, saved = block
    for segment in range(len(saved)):
        low, high = costs.knots[segment], costs.knots[segment + 1]
        rise = at_knot[segment + 1] - at_knot[segment] + costs.price * share * (high - low)
        for k in range(per_knot):
            edge = (k + (rise < 0)) / per_knot
            factor = low + edge * (high - low)
            used = share * factor
            loss = at_knot[segment] + edge * (at_knot[segment + 1] - at_knot[segment])
            cost[segment * per_knot + k] = loss + costs.price * used - saved[segment]
            use[segment * per_knot + k] = used


@compiled_loop(error_model="numpy")
def _windows(lowest: Integers, highest: Integers, edges: Array, first: Array, second: Array) -> None:
    """Write the lowest and the highest cell that may follow each cell.

    A step must keep the limits at both its ends. All four conditions are first made rising from cell to cell,
    by the running maximum or minimum on the side that allows more, so that what follows a cell is one stretch
    and the stretches rise: a limit with a dip may allow more than it should, never less.
    """
    cells = len(lowest)
    top, follow, end = -np.inf, 0, cells - 1
    bottom_ahead = np.empty(cells)  # least factor from which some cell at or above this one is reached
    least = np.inf
    for cell in range(cells - 1, -1, -1):
        least = min(least, edges[cell] - second[cell])
        bottom_ahead[cell] = least
    for cell in range(cells):
        top = max(top, edges[cell + 1] + first[cell])
        follow = max(follow, cell)
        while follow < end and edges[follow + 1] <= top and bottom_ahead[follow + 1] <= edges[cell + 1]:
            follow += 1
        highest[cell] = follow
    top_behind = np.empty(cells)  # largest factor from which some cell at or below this one is reached
    most = -np.inf
    for cell in range(cells):
        most = max(most, edges[cell + 1] + second[cell])
        top_behind[cell] = most
    bottom, follow = np.inf, cells - 1
    for cell in range(cells - 1, -1, -1):
        bottom = min(bottom, edges[cell] - first[cell])
        follow = min(follow, cell)
        while follow > 0 and edges[follow] >= bottom and top_behind[follow - 1] >= edges[cell]:
            follow -= 1
        lowest[cell] = follow
