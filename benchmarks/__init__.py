"""Error against time: ours, and the programs and methods that ours is compared with. In no zip."""
