"""Launches: flight of a released object, scatter of its landings, and the result of a launch in a plan.

Files, each importing only from those above it:

    flight          free flight of a released object, and the flight that a [launch] table asks for
    landings        scatter of the landings of launches
    launch_result   release and flight of a launch, in the axes of the robot file
"""
