"""Swings of point masses: hypocycloids between any points, and transitions from rest and back.

The effector swings like a pendulum that hangs from the centroid of the spools, with the natural frequency
sqrt(gravity / z0), while the amplitude of the swing grows or shrinks along an amplitude function A. The acceleration
is then proportional to the displacement from the equilibrium P0 = (0, 0, z0), and opposite to it, up to terms that fade
with the number of arcs, and every cable stays taut far beyond the footprint of the spools. A motion is feasible if
the pseudotensions of all cables, (2.12) to (2.14), and the depth below the spools stay positive; bounds of their second
derivatives turn samples into proofs.

Source: Dion-Gauvin's thesis, chapter 1 (transitions: oscillations and their envelopes) and chapter 2 (standard
hypocycloids: numbers of arcs).

Files, each importing only from those above it:

    hypocycloid             segment between two points, (2.31) to (2.55)
    transition              segment between rest and a point, chapter 1
    depths                  guides for the choice of z0
    zero_tension            closed forms for the amplitude function A = tau, sections 1.6 and 1.10
    envelopes               lower envelopes of the pseudotensions of a transition
    envelope_oscillations   numbers of oscillations for which the envelopes stay positive
    slacks                  taut cables and depth, with bounds of their second derivatives
    limit_slacks            slacks of limits, likewise
    criteria                all criteria in one order
    blocks                  cuts of a segment at the knots of its amplitude function
    enclosures              bounds of the state over a block of time, for robots that differ a little
    proof                   verdicts that hold between the samples
    margins                 smallest slacks, refined
    transition_margins      smallest slacks of transitions, from two functions of time
    sieve                   upper bounds of the margins of all numbers of arcs at once
    parities                segments for even and for odd numbers of arcs
    limit_sieve             candidates that a few instants refute by a limit
    refusals                limits that refuse every number of arcs
    redundant_arcs          smallest numbers of arcs on more cables than degrees of freedom
    redundant_inclinations  inclinations that need the fewest oscillations there
    decide                  upper bounds -> answers: proofs first, margins after
    arcs                    smallest numbers of arcs of many segments
    oscillations            smallest numbers of oscillations of many transitions
    hypocycloid_leg         hypocycloids in a plan
    transition_leg          transitions in a plan
    arcs_map                maps of numbers of arcs
    oscillations_map        maps of numbers of oscillations
    envelopes_map           maps of the oscillations that each instant of a transition needs
"""
