"""Numbers of robots that objectives and requirements are about.

A measure has columns, such as the margins of the cells of a map, from the functions that everybody uses; and it has the
derivatives of their elements, exact ones where robots are lanes of kernels, else by differences.

Files, each importing only from those above it:

    measure      the protocol
    maps         datasets of a map
    workspaces   those of maps of workspaces, of many robots at once, with exact derivatives
    plans        fields of the segments of a plan
    frames       sizes of the frame, numbers of the robot file, distances in a hall
    groups       measures of robots that are set anew between tasks
"""
