"""Feasibility of transitions: oscillations, envelopes, margins."""
