"""Workspaces: poses at which the cables of a robot can hold its effector, for any robot on any number of cables.

Static, wrench-feasible and wrench-closure workspaces rest on one test: a pose is inside if along every facet normal
(normal to dof - 1 columns of the wrench matrix) tensions within their limits supply the required wrenches. The margin,
in newtons, is the smallest slack of all facet normals, computed as two bounds that allow for rounding. With tensions
over lengths as unknowns the matrix is affine in the position, so that full cells of a grid can be proved. The package
also has clearances, speeds of cables, sets of orientations, sensitivities and feasible accelerations.

Sources: hyperplane shifting by Bouchard, Gosselin and Moore (2010) and by Gouttefarde and Krut (2010); docs/theory.md
has the formulas.

Files, each importing only from those above it:

    required_wrenches     wrenches that cables must supply
    poses                 margins of poses, one by one and compiled
    requirements          conditions with their limits and wrenches
    search                margins and verdicts of many poses
    search_over_robots    margins and verdicts of poses of many robots
    cells                 proofs of full cells
    all_robots            requirements of all robots within an uncertainty
    clearances            clearances of robots at rest
    static_poses          all conditions together, and sets of orientations
    static_cells          all conditions together over cells
    acceleration_search   feasible accelerations at many positions
    sensitivities         sensitivities to errors of the cable lengths
    map                   maps of workspaces
    map_over_robots       maps of workspaces of many robots at once
    any_cable_gone        maps of what is left of a workspace when any one cable is gone
    accelerations_map     maps of feasible accelerations
    sensitivity_map       maps of sensitivities
"""
