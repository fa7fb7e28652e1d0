"""Levels of a hybrid MDP above the metric one: regions, wings, floors (paper, Figure 2).

S states, R regions, B parts of a level.  Levels are counted from the bottom: the metric level is 1, regions are 2
(the default), wings 3, floors 4.  A level is a partition of the level below it.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from qualrl.errors import SettingError
from qualrl.models.landmarks import LandmarkLevel, landmark_level
from qualrl.qualitative.graph import SCHEMA, Graph
from qualrl.spatial.naming import letters

MOST_LEVELS = 4
LEAST_WING = 3
"""Regions of a wing, where so many hang together: a room with its side room is none."""


@dataclass(frozen=True)
class Grouping:
    """The parts of a level as groups of the next finer level's."""

    names: tuple[str, ...]
    """(B,)"""
    of: tuple[int, ...]
    """Part of each part of the finer level."""

    def __post_init__(self) -> None:
        if len(set(self.names)) != len(self.names):
            raise SettingError(f"each part of a level needs a name of its own, got {list(self.names)}")
        if set(self.of) != set(range(len(self.names))):
            raise SettingError(f"each of the {len(self.names)} parts of a level needs a part below it")


@dataclass(frozen=True, eq=False)
class QualitativeLevel:
    """One qualitative level: named parts of the states, and the actions between them."""

    names: tuple[str, ...]
    """(B,) names of the qualitative states."""
    part_of: NDArray[np.int32]
    """(S,) qualitative state of each state of the metric level."""
    members: tuple[tuple[str, ...], ...]
    """(B,) names of the parts of the next finer level in each; empty for regions."""
    graph: Graph
    """Frozen: a node a qualitative state, an edge a qualitative action."""
    landmarks: LandmarkLevel
    """The landmarks at which one part meets another, and the goal; on the finest level, all landmarks."""


def coarser_level(finer: QualitativeLevel, grouping: Grouping) -> QualitativeLevel:
    """The level whose parts are groups of another level's."""
    if len(grouping.of) != len(finer.names):
        raise SettingError(f"{len(grouping.of)} of the {len(finer.names)} parts are given a group")
    of = np.array(grouping.of, np.int32)
    members = tuple(
        tuple(name for name, part in zip(finer.names, grouping.of, strict=True) if part == group)
        for group in range(len(grouping.names))
    )
    return QualitativeLevel(
        grouping.names,
        of[finer.part_of],
        members,
        _coarser_graph(finer, grouping, members),
        _joints(finer.landmarks, grouping.of),
    )


def _coarser_graph(finer: QualitativeLevel, grouping: Grouping, members: tuple[tuple[str, ...], ...]) -> Graph:
    """Groups as nodes; the edges that lead from one group to another stay.

    Centre-to-centre lengths are left out: a group has no centre that one walks to.
    """
    graph: Graph = nx.MultiDiGraph(schema=SCHEMA)
    for name, inside in zip(grouping.names, members, strict=True):
        area = {"area_m2": sum(float(finer.graph.nodes[part].get("area_m2", 0.0)) for part in inside)}
        graph.add_node(name, parts=len(inside), **(area if area["area_m2"] else {}))
    group = dict(zip(finer.names, grouping.of, strict=True))
    for here, there, key, data in finer.graph.edges(keys=True, data=True):
        one, other = grouping.names[group[here]], grouping.names[group[there]]
        if one != other:
            kept = {name: value for name, value in data.items() if name not in ("length_m", "action")}
            action = f"go through {data['door']} to {other}" if "door" in data else data["action"]
            graph.add_edge(one, other, key=key, action=action, **kept)
    nx.freeze(graph)
    return graph


def _joints(finer: LandmarkLevel, of: Sequence[int]) -> LandmarkLevel:
    """The landmarks that join two groups; the last landmark, the goal, stays whatever it joins."""
    groups = [sorted({of[part] for part in joined}) for joined in finer.regions]
    kept = [mark for mark, joined in enumerate(groups) if len(joined) > 1 or mark == len(groups) - 1]
    new_index = np.full(len(groups) + 1, -1, np.int32)
    new_index[kept] = np.arange(len(kept))
    return landmark_level(
        [finer.names[mark] for mark in kept], new_index[finer.landmark_of], [groups[mark] for mark in kept]
    )


def wings_of(graph: Graph) -> dict[str, tuple[str, ...]]:
    """The regions of each wing of a map's graph: wing A, wing B, ...; regions that nothing connects are no wings.

    Wings are what the graph's doorways hold together: communities of greatest modularity, each connected.
    """
    grouping = _named("wing", graph, _communities(graph))
    inside: dict[str, list[str]] = {name: [] for name in grouping.names}
    for node, of in zip(graph.nodes, grouping.of, strict=True):
        inside[grouping.names[of]].append(node)
    return {name: tuple(regions) for name, regions in inside.items() if name not in graph}


def groupings(graph: Graph, levels: int) -> tuple[Grouping, ...]:
    """The groupings above the regions of a graph: none for levels=2, wings for 3, wings and floors for 4."""
    if levels not in range(2, MOST_LEVELS + 1):
        raise SettingError(
            f"levels must be 2 (grid and regions), 3 (and wings) or {MOST_LEVELS} (and floors), got {levels}"
        )
    if levels == 2:
        return ()
    wings = _named("wing", graph, _communities(graph))
    if levels == 3:
        return (wings,)
    floors = _named("floor", graph, _components(graph))
    return wings, Grouping(floors.names, tuple(floors.of[wings.of.index(w)] for w in range(len(wings.names))))


def _bonds(graph: Graph) -> "nx.Graph[int]":
    """Regions by number; the wider the doorways between two, the stronger their bond.

    Numbers and not names: the order in which sets of strings are walked differs from process to process.
    """
    bonds: nx.Graph[int] = nx.Graph()
    number = {name: i for i, name in enumerate(graph.nodes)}
    bonds.add_nodes_from(number.values())
    for here, there, data in graph.edges(data=True):
        one, other = number[here], number[there]
        before = bonds.edges[one, other]["weight"] if bonds.has_edge(one, other) else 0.0
        bonds.add_edge(one, other, weight=before + float(data.get("width_m", 1.0)))
    return bonds


def _components(graph: Graph) -> list[set[int]]:
    return [set(part) for part in nx.connected_components(_bonds(graph))]


def _communities(graph: Graph) -> list[set[int]]:
    """Wings: the communities of greatest modularity, found greedily within each connected part of the graph."""
    bonds = _bonds(graph)
    found = list[set[int]]()
    for part in nx.connected_components(bonds):
        inside = nx.Graph(bonds.subgraph(sorted(part)))
        if len(part) < LEAST_WING:
            found.append(set(part))
            continue
        pieces = list[set[int]]()
        for community in nx.community.greedy_modularity_communities(inside, weight="weight"):
            pieces += [set(piece) for piece in nx.connected_components(inside.subgraph(community))]
        found += _without_suites(pieces, inside)
    return found


def _without_suites(pieces: list[set[int]], bonds: "nx.Graph[int]") -> list[set[int]]:
    """The parts of a connected graph with those of a room or two joined, smallest first, to what they are bound to."""
    pieces = sorted(pieces, key=lambda piece: (len(piece), min(piece)))
    while len(pieces) > 1 and len(pieces[0]) < LEAST_WING:
        small = pieces.pop(0)
        host = max(pieces, key=lambda piece: (nx.cut_size(bonds, small, piece, weight="weight"), -min(piece)))
        host |= small
        pieces.sort(key=lambda piece: (len(piece), min(piece)))
    return pieces


def _named(kind: str, graph: Graph, parts: list[set[int]]) -> Grouping:
    """Names "wing A", "wing B", ..., by the first region of each; a lone pocket of the map keeps its own name."""
    parts = sorted(parts, key=min)
    nodes = list(graph.nodes)
    names, count, of = list[str](), 0, [0] * len(nodes)
    for index, part in enumerate(parts):
        name = nodes[min(part)]
        if len(part) > 1 or graph.nodes[name].get("kind") != "pocket":
            count = next(n for n in itertools.count(count) if f"{kind} {letters(n)}" not in graph)
            name, count = f"{kind} {letters(count)}", count + 1
        names.append(name)
        for region in part:
            of[region] = index
    return Grouping(tuple(names), tuple(of))
