"""The classical solvers of the radiosity system, behind one signature, with the systems that tell them apart."""
