"""Graph files: node-link JSON and GraphML, as networkx reads and writes them."""

import json
from pathlib import Path
from typing import Any

import networkx as nx

from qualrl.errors import MapError
from qualrl.qualitative.graph import SCHEMA, Graph


def graph_to_data(graph: Graph) -> dict[str, Any]:
    """The node-link form of a graph: plain dicts, lists, numbers and strings."""
    data: dict[str, Any] = nx.node_link_data(graph, edges="edges")
    return data


def write_graph_json(graph: Graph, file: Path) -> None:
    """Write node-link JSON (keys nodes, edges, graph, directed, multigraph)."""
    file.write_text(json.dumps(graph_to_data(graph), indent=1) + "\n", encoding="utf-8")


def write_graphml(graph: Graph, file: Path) -> None:
    """Write GraphML."""
    nx.write_graphml_xml(graph, file)


def read_graph_json(file: Path) -> Graph:
    """Read a graph that ``write_graph_json`` wrote.  Raises MapError for anything else."""
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
        known = data["graph"]["schema"] == SCHEMA
        graph: Graph = nx.MultiDiGraph(nx.node_link_graph(data, edges="edges"))
    except (OSError, ValueError, KeyError, TypeError, nx.NetworkXError) as error:
        raise MapError(f"{file}: not a graph file of qualrl ({error})") from None
    if not known:
        raise MapError(f"{file}: schema {data['graph']['schema']!r}, but this version reads {SCHEMA!r}")
    nx.freeze(graph)
    return graph
