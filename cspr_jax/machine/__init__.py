"""The machine: what drives the cables of a robot, from proved motions to motors, and back from measured lengths.

Numbers of winches and elastic cables are part of the robot (`robots.model.winches`), and their limits are limits like
all others (`schema.limits`). Stiffness and natural frequencies of poses are `robots.elasticity`, since maps of
workspaces ask for them, too. Sign conventions are those of `robots.model.winches`.

Files, each importing only from those above it:

    drum_motions         what drums pay out along a motion, with derivatives, and their motors
    setpoints            the same at the ticks of a clock, along consecutive motions
    sizing               the largest torques, speeds and powers along motions, root mean squares and energies
    forward_kinematics   from lengths to poses
    motion_frequencies   natural frequencies along motions on elastic cables
    stops                proved ways to rest from states of a motion, also when cables break
    calibration          spools, attachment points, offsets and radii from measurements
    logs                 recorded logs beside plans: delay, cables that disagree or are slack
"""
