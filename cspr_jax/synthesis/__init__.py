"""Dimensional synthesis: the best robot among those that parameters and arrangements of the cables give.

A design file names what is better (objectives) and what must hold (requirements): numbers of maps, of plans, of the
frame, of a hall. A search screens points of a Sobol sequence and all arrangements, improves the best few, evaluates
each robot exactly, and proves requirements in full cells. Where numbers have derivatives the improvement is exact: the
smallest of many smooth functions is made large with a level as a further unknown, by sequential quadratic programming
over those functions that are nearly the smallest; fractions of cells are counted smoothly, with steps that sharpen;
numbers that jump are left to differential evolution.

Files, each importing only from those above it:

    space           robots of a design: values of parameters and an arrangement
    measures        numbers of robots: maps, plans, frames, halls, with derivatives
    questions       objectives and requirements, and the smooth functions that decide them
    evaluations     exact numbers of robots, which robot is better, and the record of all
    screening       the first robots
    exchange        local search where numbers have derivatives
    counting        local search for fractions of cells
    evolution       search where numbers jump
    proofs          proofs of requirements in full cells
    search          one objective, or the front of two
    sensitivities   derivatives, and what holds the parameters
    problem         a design file as robots, measures and questions
    reconfiguration  settings for tasks, with as few changes as can be
    results         robots that were found
    record          the directory in which a design is resumed
    run             from a file to its robots
"""
