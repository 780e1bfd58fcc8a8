# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The travel graph: named nodes and the edges between them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.exploration.travel.stop import MIN_REACH_M, Stop
from soilmoist_ros.foundation import InputError, Mistake, PlaneMove, did_you_mean, listing

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

ALL_PAIRS_UP_TO = 2000
"""Maximum number of nodes for which all pairs are kept (48 MB at this size); larger graphs keep used rows."""


@dataclass(frozen=True, eq=False)
class TravelGraph:
    """Named nodes and directed edges between them. Made by :meth:`from_edges`.

    :param names: names of the nodes, unique
    :param xy: their places, shape (n, 2) [m]
    :param edges: start and end of each edge as indices of nodes, shape (e, 2)
    :param length_m: length of each edge, shape (e,) [m], >= 0
    """

    names: tuple[str, ...]
    xy: Array
    edges: Indices
    length_m: Array
    _rows: dict[int, tuple[Array, Indices]] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def from_edges(
        cls,
        nodes: Sequence[Stop],
        edges: Iterable[tuple[str, str]],
        length_m: Sequence[float] | None = None,
        *,
        connected: bool = True,
        path: Path | None = None,
    ) -> TravelGraph:
        """Graph of nodes and of edges given by the names of their ends.

        :param nodes: the nodes, at least one
        :param edges: (start, end) of each edge; give both directions if the robot may drive both
        :param length_m: length of each edge [m]; default: the straight distance
        :param connected: refuse nodes that cannot be reached from the others, or not be left again
        :param path: file to name in messages
        :raises InputError: with every unknown end, duplicate name, bad place or length, and unreachable node
        """
        pairs = list(edges)
        names = tuple(node.name for node in nodes)
        xy = np.array([(node.x_m, node.y_m) for node in nodes], float).reshape(-1, 2)
        mistakes = [*_mistakes_in_nodes(names, xy, path), *_mistakes_in_edges(names, pairs, path)]
        if mistakes:
            raise InputError(mistakes)
        index = {name: number for number, name in enumerate(names)}
        ends = np.array([(index[start], index[end]) for start, end in pairs], np.intp).reshape(-1, 2)
        straight = np.hypot(*(xy[ends[:, 1]] - xy[ends[:, 0]]).T)
        lengths = straight if length_m is None else np.asarray(length_m, float)
        if lengths.shape != straight.shape or not (np.isfinite(lengths) & (lengths >= 0)).all():
            raise InputError("every way needs a length that is finite and not negative", "check the lengths", path)
        graph = cls(names, xy, ends, lengths)
        if connected:
            graph.require_connected(path)
        return graph

    def moved(self, move: PlaneMove) -> TravelGraph:
        """The graph in the coordinates of another plane; itself if the two planes are one."""
        return (
            self if move.is_identity else TravelGraph(self.names, move.places(self.xy), self.edges, self.length_m)
        )

    @cached_property
    def stops(self) -> tuple[Stop, ...]:
        """The nodes as stops, in order; each is reached nearer to it than to any other node."""
        reach_m = np.maximum(self.spacing_m / 2, MIN_REACH_M)
        return tuple(
            Stop(name, float(x), float(y), float(near))
            for name, (x, y), near in zip(self.names, self.xy, reach_m, strict=True)
        )

    @cached_property
    def spacing_m(self) -> Array:
        """Distance from each node to the nearest other one, shape (n,) [m]; inf for a single node."""
        from scipy.spatial import KDTree

        return np.asarray(KDTree(self.xy).query(self.xy, k=2)[0][:, 1])

    def crowded(self) -> str:
        """Nodes so near to another one that the robot may be taken to be there; empty if there are none."""
        near = np.flatnonzero(self.spacing_m < 2 * MIN_REACH_M)
        names = listing(self.names[number] for number in near)
        return (
            f"a robot cannot tell nodes apart that are nearer to each other than {2 * MIN_REACH_M:g} m: {names}"
            if len(near)
            else ""
        )

    @cached_property
    def _index(self) -> dict[str, int]:
        return {name: number for number, name in enumerate(self.names)}

    def index(self, name: str) -> int:
        """Number of a node.

        :raises InputError: if there is none of this name
        """
        try:
            return self._index[name]
        except KeyError:
            raise InputError(
                f"the travel graph has no node {name!r}",
                f"use one of its {len(self.names)} nodes{did_you_mean(name, self.names)}",
            ) from None

    def nearest(self, xy: ArrayLike) -> str:
        """Name of the node nearest to a place as the crow flies; the first of equals."""
        return self.names[int(np.argmin(np.hypot(*(self.xy - np.asarray(xy, float)).T)))]

    def distances_from(self, start: str) -> Array:
        """Length of the shortest route to each node, shape (n,) [m]; inf if unreachable."""
        return self._tree(self.index(start))[0].copy()

    def routes_from(self, start: int, back: bool = False) -> tuple[Array, Indices]:
        """Shortest routes from one node to each, which are not kept.

        :param start: number of the node
        :param back: the routes from each node to this one instead
        :returns: their lengths, shape (n,) [m], inf without a route; and the neighbour of each node on its route,
            on the side of ``start``, shape (n,)
        """
        return self._shortest(self._matrix.T.tocsr() if back else self._matrix, start)

    def routes_to_all(self, start: int) -> tuple[Array, Indices]:
        """Shortest routes from a node to each, as :meth:`routes_from`; kept, so they must not be changed."""
        return self._tree(start)

    def distance_m(self, start: str, end: str) -> float:
        """Length of the shortest route from one node to another [m]; inf if unreachable."""
        return float(self._tree(self.index(start))[0][self.index(end)])

    def path(self, start: str, end: str) -> tuple[str, ...]:
        """Nodes of the shortest route, both ends included; empty if there is none."""
        source, node = self.index(start), self.index(end)
        length, before = self._tree(source)
        if not np.isfinite(length[node]):
            return ()
        way = [node]
        while way[-1] != source:
            way.append(int(before[way[-1]]))
        return tuple(self.names[number] for number in reversed(way))

    def reachable(self, start: str) -> frozenset[str]:
        """Nodes that can be reached, the start included."""
        return frozenset(self.names[number] for number in np.flatnonzero(np.isfinite(self.distances_from(start))))

    def components(self) -> Indices:
        """Number of the part of the graph to which each node belongs, shape (n,).

        Two nodes are of one part if each can be reached from the other. Parts are numbered from the
        largest (0) to the smallest, the one that holds the earliest node first among equals.
        """
        from scipy.sparse.csgraph import connected_components

        _, label = connected_components(self._matrix, directed=True, connection="strong")
        found, first, size = np.unique(label, return_index=True, return_counts=True)
        rank = np.empty(len(found), np.intp)
        rank[np.lexsort([first, -size])] = np.arange(len(found))
        return np.asarray(rank[np.searchsorted(found, label)], np.intp)

    def require_connected(self, path: Path | None = None) -> None:
        """Check that every node can be reached from every other.

        :param path: file to name in the message
        :raises InputError: with the names of the nodes that cannot be reached or not be left
        """
        part = self.components()
        if not part.any():
            return
        main = self.names[int(np.argmin(part))]
        to = np.isfinite(self.distances_from(main))
        back = np.isfinite(self.routes_from(self.index(main), back=True)[0])
        remedy = "add the missing edges (each direction is a separate edge) or remove these nodes"
        faults = [
            ("no way leads from the rest of the graph to", ~to),
            ("no way leads back to the rest of the graph from", to & ~back),
        ]
        raise InputError(
            [
                Mistake(f"{what} {listing(self.names[i] for i in np.flatnonzero(which))}", remedy, path)
                for what, which in faults
                if which.any()
            ]
        )

    def part(self, keep: NDArray[np.bool_]) -> TravelGraph:
        """The graph of some of the nodes and the edges between them.

        :param keep: nodes to keep, shape (n,)
        """
        number = np.cumsum(keep) - 1
        within = keep[self.edges].all(axis=1)
        names = tuple(name for name, kept in zip(self.names, keep, strict=True) if kept)
        return TravelGraph(names, self.xy[keep], number[self.edges[within]], self.length_m[within])

    @cached_property
    def _matrix(self) -> Any:
        """Lengths as a sparse matrix; the shortest of parallel edges."""
        from scipy.sparse import csr_array

        order = np.lexsort([self.length_m, self.edges[:, 1], self.edges[:, 0]])
        ends, lengths = self.edges[order], self.length_m[order]
        first = np.ones(len(ends), bool)
        first[1:] = (ends[1:] != ends[:-1]).any(axis=1)
        size = len(self.names)
        return csr_array((lengths[first], (ends[first, 0], ends[first, 1])), shape=(size, size))

    @cached_property
    def _all_pairs(self) -> tuple[Array, Indices]:
        return self._shortest(self._matrix, None)

    def _tree(self, source: int) -> tuple[Array, Indices]:
        """Shortest lengths from a node, and the node before each on the route."""
        if len(self.names) <= ALL_PAIRS_UP_TO:
            lengths, before = self._all_pairs
            return lengths[source], before[source]
        if source not in self._rows:
            self._rows[source] = self._shortest(self._matrix, source)
        return self._rows[source]

    @staticmethod
    def _shortest(matrix: Any, source: int | None) -> tuple[Array, Indices]:
        from scipy.sparse.csgraph import dijkstra

        lengths, before = dijkstra(matrix, indices=source, return_predecessors=True)
        return np.asarray(lengths), np.asarray(before)


def _mistakes_in_nodes(names: Sequence[str], xy: Array, path: Path | None) -> list[Mistake]:
    if not names:
        return [Mistake("the travel graph has no nodes", "give at least one place the robot can go to", path)]
    mistakes = []
    double = [name for name, count in Counter(names).items() if count > 1]
    if double:
        message = f"more than one node has the name {listing(double)}"
        mistakes.append(Mistake(message, "give each its own name", path))
    lost = [name for name, place in zip(names, xy, strict=True) if not np.isfinite(place).all()]
    if lost:
        mistakes.append(Mistake(f"the place is not finite of {listing(lost)}", "give x and y in metres", path))
    return mistakes


def _mistakes_in_edges(names: Sequence[str], pairs: Sequence[tuple[str, str]], path: Path | None) -> list[Mistake]:
    known = set(names)
    remedy = "add the node or remove the edge"
    return [
        Mistake(f"the edge from {a!r} to {b!r}: there is no node {end!r}{did_you_mean(end, names)}", remedy, path)
        for a, b in pairs
        for end in dict.fromkeys((a, b))
        if end not in known
    ]
