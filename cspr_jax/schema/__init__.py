"""What results are made of: verdicts, quantities, tiles, identities. No jax."""
