"""What results are made of: verdicts, quantities, limits, tiles, identities. No jax."""
