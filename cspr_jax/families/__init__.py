"""Trajectory families: one folder each, with all of its formulas, proofs and maps. No family imports another."""
