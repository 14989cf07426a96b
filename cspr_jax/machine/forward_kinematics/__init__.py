"""Forward kinematics: from lengths of the cables to poses of the effector, of any robot, with pulleys.

A point mass on as many cables as degrees of freedom has its solutions in closed form, a platform in the plane on three
cables by the zeros of a trigonometric polynomial: all of them, and no others. All other poses are found by least
squares, from one start or from many; residuals of redundant cables say how well the lengths agree. Where cables may be
slack, the pose is that of least potential energy.

Files, each importing only from those above it:

    lengths           lengths from lengths or angles of motors
    spheres           points at given distances from spools: one point mass, both sides
    planar_platforms  all poses of a platform in the plane on three cables
    least_squares     damped Gauss-Newton steps, many poses at once
    solutions         one solution, or all that are found, for each set of lengths
    equilibrium       poses of equilibrium where cables may be slack
"""
