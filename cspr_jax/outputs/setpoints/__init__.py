"""Set points as files that controllers read.

Files, each importing only from those above it:

    plain_csv          a header line and numbers
    joint_trajectory   trajectories of joints of ROS 2, as YAML or JSON
    cyclic_table       counts of encoders at the cycles of a controller
    formats            one row a format, by the ending of the file; plans written in them
"""
