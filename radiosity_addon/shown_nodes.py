"""The nodes of a tree that its output shows."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from .sockets import feeding


def shown_nodes(tree: Any) -> Iterator[Any]:
    """The nodes behind a tree's output and in its groups; what is muted or linked to nothing is not shown."""
    output = tree.get_output_node("CYCLES")
    return _behind(output, {tree.name_full}) if output is not None else iter(())


def _behind(output: Any, trees: set[str]) -> Iterator[Any]:
    """The nodes behind an output node, each once, those of groups in trees that are not known yet too."""
    waiting, seen = [output], {output.name}
    while waiting:
        sources = (feeding(socket) for socket in waiting.pop().inputs if socket.enabled)
        for node in (source.node for source in sources if source is not None):
            if node.name in seen:
                continue
            seen.add(node.name)
            waiting.append(node)
            yield node
            inner = node.node_tree if node.bl_idname == "ShaderNodeGroup" else None
            if inner is not None and inner.name_full not in trees:
                trees.add(inner.name_full)
                ends = (end for end in inner.nodes if end.bl_idname == "NodeGroupOutput" and end.is_active_output)
                for end in ends:
                    yield from _behind(end, trees)
