"""Swings of point masses: hypocycloids between any points, and transitions from and to rest.

The effector swings like a pendulum that hangs from the centroid of the spools, with the natural frequency
sqrt(gravity / z0), while its amplitude grows or shrinks along an amplitude function A. So the acceleration is
proportional to the displacement from the equilibrium P0 = (0, 0, z0) and opposite to it, up to terms that vanish as the
number of arcs grows, and every cable stays taut far beyond the footprint of the spools. A motion is feasible if the
pseudotensions of all cables, (2.12) to (2.14), and the depth below the spools stay positive; bounds of their second
derivatives make proofs of samples.

Source: Dion-Gauvin's thesis, chapter 1 (transitions: oscillations and their envelopes) and chapter 2 (standard
hypocycloids: numbers of arcs).

Files, each importing only from those above it:

    hypocycloid       segment between two points, (2.31) to (2.55)
    depths            guides for the choice of z0
    parities          segments for even and for odd numbers of arcs
    proof             the fast proof of swings
    refusals          limits that refuse every number of arcs
    redundant_arcs    smallest numbers of arcs on more cables than degrees of freedom
    decide            answers from upper bounds of margins: proofs first, margins after
    arcs              smallest numbers of arcs of many segments
    transitions       transitions from and to rest, chapter 1
    hypocycloid_leg   hypocycloids in a plan
    arcs_map          maps of numbers of arcs
"""
