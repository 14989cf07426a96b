"""Paths along which a motion runs in the least time that the robot allows.

A path is a curve over a coordinate s that is close to the travelled length, with a stop at each corner that is not
blended. Its sections, from stop to stop, are quintic Hermite pieces, continuous with their first derivative. So are the
orientations along them, as quaternions that are normalised afterwards.

Files, each importing only from those above it:

    geometry        elements, corners and sections of paths
    least_time      the least time along sections
    batch           least times along many paths at a time
    fastest_lines   lines from which searches for free motions start
    answers         answers of segments of paths
    retraced        paths of planned motions, as sections
    leg             poses joined along paths, as a leg of plans
    map             maps of least durations along paths
"""
