"""Other people's programs on the same lumels and the same form factors, in an environment of their own (docs/peers.md)."""
