"""Stops: from a state of a motion to rest in the least time, proved; also of a robot that has just lost cables.

Motions to rest are of three kinds. Free motions come to rest anywhere, in the least time that a search finds: the
search of free motions, whose last pose may shift. Others stay on the path of the motion and run along it ever more
slowly, or go on to the next place of rest. Where none of these is found, swings about P0 at the natural frequency let
their amplitude die. Every motion begins with the position, velocity and acceleration of the instant (where a cable has
broken, tensions jump, and so may the acceleration) and is proved by the proof of any motion. That none is found proves
nothing.

Files, each importing only from those above it:

    instants        states from which a robot is stopped, in the axes of the robot that stops
    candidates      the fastest proved motion of several
    braking         stops along the path
    dying_swings    swings that die
    free_stops      the fastest stops along any path
    fastest         the fastest stop from each instant
"""
