"""Sweeps: what a file asks, who computes its tiles, and how a run goes on after it was stopped."""
