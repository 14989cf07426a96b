"""Tables of families, kinds of map, limits and quantities; verdicts, tiles and identities. No jax."""
