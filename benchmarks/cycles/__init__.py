"""Our baker against Cycles' own bake, on the same lumels of real scenes.

Read `compare.py` first: it makes the diffuse twin of a scene (`twin.py`), bakes it with Cycles (`reference.py`), bakes
it with our program through its command line, and puts the difference into numbers (`solver/estimator.py`).
"""
