"""The number that Object Info calls random: the same for an object in every render."""

from __future__ import annotations

from typing import Any

# Blender's random numbers of objects are 32 bits.
LARGEST = 2**32 - 1
# Rotations of the final mix of Bob Jenkins' hash lookup3 (2006), and the start of its state for two words.
ROTATIONS = (14, 11, 25, 16, 4, 14, 24)
START = (0xDEADBEEF + (2 << 2) + 13) & LARGEST


def random_of(instance: Any) -> float:
    """Between 0 and 1, for an instance of the dependency graph; that of a real object comes from its name alone."""
    if instance.is_instance:
        return float((instance.random_id & LARGEST) / LARGEST)
    state = 0
    for byte in instance.object.name.encode():
        state = (state * 37 + byte) & LARGEST
    return mixed(state, 0) / LARGEST


def mixed(first: int, second: int) -> int:
    """lookup3's hash of two 32-bit words."""
    words = [(START + first) & LARGEST, (START + second) & LARGEST, START]
    # c by b, a by c, b by a, and so on.
    target, source = 2, 1
    for turn in ROTATIONS:
        rotated = ((words[source] << turn) | (words[source] >> (32 - turn))) & LARGEST
        words[target] = ((words[target] ^ words[source]) - rotated) & LARGEST
        target, source = (target + 1) % 3, target
    return words[2]
