"""Connected components of graphs, against a search by hand."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver.components import components


@pytest.mark.parametrize("nodes", [3, 20, 300])
def test_a_star_is_one_component_wherever_its_middle_is(nodes):
    # The last (or first) node is joined to all others, the edges in rising or falling order.
    others = np.arange(nodes - 1)
    for middle, ends in ((nodes - 1, others), (nodes - 1, others[::-1]), (0, others + 1), (0, others[::-1] + 1)):
        assert components(nodes, ends, np.full(nodes - 1, middle)).max() == 0


def test_random_graphs_have_the_components_that_a_search_finds():
    # 200 graphs of 2 ... 30 nodes and 1 ... 40 edges; labels are numbered by each component's first node.
    rng = np.random.default_rng(0)
    for _ in range(200):
        count, edges = int(rng.integers(2, 30)), int(rng.integers(1, 40))
        a, b = rng.integers(0, count, (2, edges))
        label = np.arange(count)
        for _ in range(count):
            for i, j in zip(a, b, strict=True):
                label[i] = label[j] = min(label[i], label[j])
        assert components(count, a, b).tolist() == np.unique(label, return_inverse=True)[1].tolist()
