"""What a first run loads, in processes of their own, and the parts that keep it light."""

import shutil
import subprocess
import sys

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from qualrl.commands.main import IN_SHORT, loaded
from qualrl.kernels import linking
from qualrl.learning.relevant import on_closed_ways
from tests import tracing
from tests.test_commands import ROOT

HEAVY = ("scipy.linalg", "scipy.sparse", "networkx", "sympy", "matplotlib", "qualrl.learning.hierarchical")
LEARN = """
import sys, qualrl
model = qualrl.load_scenario("puzzle").build()
qualrl.train(model, {algorithm!r}, episodes=2).plan()
"""
LOADED = f"print([name for name in {HEAVY} if name in sys.modules])"
HELP = """
import sys
from qualrl.commands.main import main
sys.argv[1:] = {arguments!r}
try:
    main()
except SystemExit as ended:
    print(ended.code)
print([name for name in sys.modules if name.startswith(("qualrl.", "numpy"))])
"""
LOOKED_FOR = """
import sys
before = set(sys.modules)  # coverage, if this is measured by it
import qualrl.kernels.jit
print([name for name in ("scipy", "coverage") if name in sys.modules.keys() - before])
import coverage, scipy
print([name for name in ("scipy", "coverage") if name in sys.modules])
"""
OTHERS_CODE = """
import numba, numpy as np
own = numba.njit(lambda a: a @ np.ascontiguousarray(np.linalg.inv(a)) + np.cov(a))
a = np.array([[2.0, 1.0], [1.0, 3.0]])
print(np.allclose(own(a), np.eye(2) + np.cov(a)))
made = numba.njit(lambda n: [np.full(k, k) for k in range(n)])
print(sum(int(part.sum()) for part in made(4)))
"""

OWN_LOOP = """
import numpy as np
from qualrl.kernels.jit import compiled, compiled_bare, compiled_part

@compiled_part
def half(n):
    if n < 0:
        raise ValueError("half of what is below 0")
    return n // 2

@compiled_bare
def quarter(n):
    return half(half(n)) + half(0)

@compiled
def counted(n):
    if n < 0:
        raise ValueError("n is below 0")
    return np.arange(n) + np.full(n, 2.0), n

@compiled
def twice(n):
    return counted(n)[0].sum() + counted(n)[0].sum()
"""
USED = """
import sys, numpy as np
sys.path.insert(0, {folder!r})
import own
print(own.counted(3)[0].sum())
try:
    own.counted(-1)
except ValueError as problem:
    print(problem)
print(own.quarter(12))
try:
    own.quarter(-1)
except ValueError as problem:
    print(problem)
print("numba.np.arrayobj" in sys.modules)
print(own.counted(np.int8(1))[0].sum() if {more} else 2.0)
print(own.twice(3) if {more} else 18.0)
"""


PIECES = """
import sys, numpy as np
sys.path.insert(0, {folder!r})
from qualrl.kernels.linking import pieces
print(pieces(np.array([0, 1]), np.array([1, 2]), 4).tolist(), "numba.np.arrayobj" in sys.modules)
"""


def output_of(code: str, **more: str) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True,
        env=tracing.environment_without() | more,
    )  # fmt: skip
    return done.stdout.split("\n")[:-1]


@pytest.mark.parametrize("algorithm", ["q-learning", "hql", "hql-replay"])
def test_learning_and_planning_load_nothing_heavy_that_they_do_not_need(algorithm):
    assert output_of(LEARN.format(algorithm=algorithm) + LOADED) == ["[]"]


def test_help_names_every_command_and_loads_none_of_them():
    *told, code, modules = output_of(HELP.format(arguments=["--help"]))
    assert [line.split()[0] for line in told if line.startswith("  ") and line.split()[0] in IN_SHORT] == list(IN_SHORT)
    assert (code, modules) == ("0", "['qualrl.commands', 'qualrl.commands.main']")


def test_the_list_of_learners_is_printed_without_numpy():
    *told, modules = output_of(HELP.format(arguments=["learners"]))
    assert any("hql-replay" in line for line in told)
    assert "numpy" not in modules


@pytest.mark.parametrize("name", IN_SHORT)
def test_a_command_that_is_called_has_its_name_and_tells_what_it_does(name):
    command = loaded(name)
    assert command.name == name
    assert command.get_short_help_str()


def test_numba_is_loaded_without_what_it_only_looks_for_and_that_can_be_loaded_later():
    assert output_of(LOOKED_FOR) == ["[]", "['scipy', 'coverage']"]


def test_code_of_others_compiles_with_linear_algebra_and_counted_references_as_without_us():
    assert output_of("import qualrl.kernels.jit" + OTHERS_CODE) == ["True", "14"]


def test_machine_code_on_disk_is_used_without_the_compiler_and_more_can_be_compiled_after_it(tmp_path):
    (tmp_path / "own.py").write_text(OWN_LOOP)
    first, second, third = (output_of(USED.format(folder=str(tmp_path), more=more)) for more in (False, False, True))
    same = ["9.0", "n is below 0", "3", "half of what is below 0"]
    assert first == [*same, "True", "2.0", "18.0"]
    assert second == third == [*same, "False", "2.0", "18.0"]


def test_an_edit_of_a_part_in_another_file_is_noticed_wherever_machine_code_is_kept(tmp_path):
    kernels = tmp_path / "qualrl" / "kernels"
    shutil.copytree(ROOT / "qualrl", kernels.parent, ignore=shutil.ignore_patterns("__pycache__"))

    def told() -> list[str]:
        return output_of(PIECES.format(folder=str(tmp_path)), NUMBA_CACHE_DIR=str(tmp_path / "kept"))

    assert [told(), told()] == [["[0, 0, 0, 1] True"], ["[0, 0, 0, 1] False"]]
    bonds = kernels / "bonds.py"
    bonds.write_text(bonds.read_text().replace("    return item\n", "    return 0\n"))
    assert told() == ["[0, 0, 0, 0] True"]


def test_a_learner_that_is_compiled_runs_without_the_compiler():
    output_of(LEARN.format(algorithm="hql"))
    assert output_of(LEARN.format(algorithm="hql") + "print('numba.np.arrayobj' in sys.modules)") == ["False"]


@st.composite
def links(draw):
    nodes = draw(st.integers(1, 12))
    node = st.integers(0, nodes - 1)
    return nodes, draw(st.lists(st.tuples(node, node), max_size=20))


@given(links())
def test_pieces_are_those_of_scipy_in_the_same_order(graph):
    nodes, pairs = graph
    start, end = np.array(pairs, np.int64).reshape(-1, 2).T.copy()
    matrix = coo_array((np.ones(len(pairs)), (start, end)), shape=(nodes, nodes))
    np.testing.assert_array_equal(linking.pieces(start, end, nodes), connected_components(matrix, directed=False)[1])


@given(links(), st.data())
def test_closed_ways_pass_what_no_bridge_cuts_off(graph, data):
    nodes, pairs = graph
    first = data.draw(st.integers(0, nodes - 1))
    twin = nx.MultiGraph()
    twin.add_nodes_from(range(nodes))
    twin.add_edges_from(pair for pair in pairs if pair[0] != pair[1])
    twin.remove_edges_from([(a, b, 0) for a, b in nx.bridges(twin)])
    expected = nx.node_connected_component(twin, first)
    assert set(np.flatnonzero(on_closed_ways(pairs, first, nodes)).tolist()) == expected
