"""Verification: proofs that any motion of any robot keeps its limits at all times, or violates them.

Slacks of criteria are bounded over blocks of time (`bounds`), which are halved until each criterion is decided
(`time_proof`); verdicts, margins and causes follow. `robustness` does the same for all robots within an uncertainty.

Files, each importing only from those above it:

    fewest_limits     the only limit that a motion violates
    proved_verdicts   verdicts that rest on a proof
    criteria          criteria of any motion
    bounds            bounds of motions over blocks of time
    time_proof        proof of criteria over the full duration of a motion, or of several
    robustness        all robots within an uncertainty
    piece_slacks      slacks of any motion over each of its pieces
    feeds             proof of largest speeds of single pieces of a motion
    proved_answers    answers of motions that give bounds of their states
    exact             exact decisions of open criteria, extremes to any number of digits
    certificates      proofs in a form that others can check
    mean_torques      root mean squares of motor torques over a full motion
    attained          smallest slacks that proved motions attain, and when
    smallest_proved   smallest numbers whose motions are proved, of many motions at once
    verifier          proofs with pulleys and contacts of motions whose families ignore these
    time_stretching   the least uniform stretching of time that is feasible
"""
