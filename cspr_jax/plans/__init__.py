"""Plans: the motions that join consecutive poses."""
