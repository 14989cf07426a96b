"""Verification: is any motion of any robot within its limits, at every time, by proof.

Slacks of criteria are bounded over blocks of time (`bounds`), which are halved until each criterion is decided
(`time_proof`); verdicts, margins and causes follow. `robustness` asks the same for all robots within an uncertainty.

Files, each importing only from those above it:

    fewest_limits     the limit that alone refuses a motion
    proved_verdicts   verdicts that rest on a proof
    criteria          criteria of any motion
    bounds            bounds of motions over blocks of time
    time_proof        proof of criteria over the whole time of a motion, or of several
    robustness        all robots within an uncertainty
    piece_slacks      slacks of any motion over each of its pieces
    feeds             proof of largest speeds that hold over some pieces of a motion alone
    proved_answers    answers of motions that give bounds of their states
    attained          smallest slacks that proved motions attain, and when
    smallest_proved   smallest numbers whose motions are proved, of many motions at once
    verifier          motions of families that know neither pulleys nor bodies that can meet, proved with both
    time_stretching   the least uniform stretching of time that is feasible
"""
