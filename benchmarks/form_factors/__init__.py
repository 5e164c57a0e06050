"""The classical methods for form factors, and ours, behind one signature, with the cases that tell them apart."""
