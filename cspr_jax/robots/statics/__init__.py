"""Statics: balances of forces and wrenches, lengths of cables, sets of wrenches, symmetries."""
