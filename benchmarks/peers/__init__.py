"""Other people's programs on the same lumels and form factors, in an environment of their own (docs/peers.md)."""
