"""Files that users write: TOML, checked, with one line for each mistake. No jax here."""
