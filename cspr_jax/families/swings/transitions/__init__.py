"""Transitions from and to rest, thesis chapter 1: numbers of oscillations, by envelopes and by proof.

Files, each importing only from those above it:

    transition               segment between rest and a point, chapter 1
    zero_tension             closed forms for the amplitude function A = tau, sections 1.6 and 1.10
    envelopes                lower envelopes of the pseudotensions of a transition
    envelope_oscillations    numbers of oscillations for which the envelopes stay positive
    redundant_inclinations   inclinations that need the fewest oscillations with redundant cables
    oscillations             smallest numbers of oscillations of many transitions, and their margins
    transition_leg           transitions in a plan
    oscillations_map         maps of numbers of oscillations
    envelopes_map            maps of the oscillations needed at each time of a transition
"""
