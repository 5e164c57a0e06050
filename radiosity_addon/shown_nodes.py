"""The nodes of a tree that its output shows."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from .sockets import is_live


def shown_nodes(tree: Any) -> Iterator[Any]:
    """The nodes behind a tree's output and in its groups; what is muted or linked to nothing is not shown."""
    output = tree.get_output_node("CYCLES")
    return _behind(output, {tree.name_full}) if output is not None else iter(())


def shows(tree: Any, kinds: frozenset[str]) -> bool:
    """Whether a tree's output shows a node of these kinds."""
    return any(node.bl_idname in kinds for node in shown_nodes(tree))


def _behind(output: Any, trees: set[str]) -> Iterator[Any]:
    """The nodes behind an output node, each once, those of groups in trees that are not known yet too."""
    feeding = _feeding(output.id_data)
    waiting, seen = [output], {output.name}
    while waiting:
        for node in feeding.get(waiting.pop().name, ()):
            if node.name in seen:
                continue
            seen.add(node.name)
            waiting.append(node)
            if node.mute:
                continue
            yield node
            inner = node.node_tree if node.bl_idname == "ShaderNodeGroup" else None
            if inner is not None and inner.name_full not in trees:
                trees.add(inner.name_full)
                ends = (end for end in inner.nodes if end.bl_idname == "NodeGroupOutput" and end.is_active_output)
                for end in ends:
                    yield from _behind(end, trees)


def _feeding(tree: Any) -> dict[str, list[Any]]:
    """The nodes that feed a node, by its name: in one go, as Blender looks for a socket's links among all of them."""
    found: dict[str, list[Any]] = {}
    for link in filter(is_live, tree.links):
        node = link.to_node
        if not node.mute or any(inside.from_socket == link.to_socket for inside in node.internal_links):
            found.setdefault(node.name, []).append(link.from_node)
    return found
