"""Parts of results: verdicts, quantities, tiles, identities. No jax."""
