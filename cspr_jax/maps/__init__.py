"""Maps, one module a kind: targets and parameters to verdicts, arcs, durations and margins."""
