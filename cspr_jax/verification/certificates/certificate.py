"""Certificates: what a proof says of a motion, in a form that others can check without this package."""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from cspr_jax.motion.formulas import MotionPiece
from cspr_jax.motion.problem import Problem
from cspr_jax.robots.contacts.clearance import Scene
from cspr_jax.robots.contacts.contact_bodies import default_scene
from cspr_jax.schema.verdicts import Verdict
from cspr_jax.verification.certificates.blocks import CONTACTS, stated_bounds, witnessed_blocks
from cspr_jax.verification.certificates.failures import NamedSlack, failure
from cspr_jax.verification.certificates.statement import (
    NoCertificateError,
    limits_statement,
    motion_statement,
    robot_statement,
    scene_statement,
)
from cspr_jax.verification.criteria import Criterion
from cspr_jax.verification.exact.decisions import BITS
from cspr_jax.verification.exact.series import SeriesPieces, precision
from cspr_jax.verification.exact.slacks import SlackFunction, slack_functions
from cspr_jax.verification.proved_answers import MotionProof

FORMAT, VERSION = "cspr-certificate", 1


def certificate(
    problem: Problem,
    motions: Sequence[list[MotionPiece]],
    proofs: Sequence[MotionProof],
    scene: Scene | None = None,
    feeds: Sequence[np.ndarray | None] = (),
    names: dict[str, str] | None = None,
) -> dict[str, Any]:
    """Certificate of consecutive motions, from the formulas and the proof of each.

    Raises:
        NoCertificateError: the verdict is not proved, or rests on what certificates do not hold.
    """
    if any(proof.verdict == Verdict.UNDECIDED for proof in proofs):
        raise NoCertificateError("the motion is neither proved nor refuted")
    if len({len(proof.criteria) for proof in proofs}) > 1:
        raise NoCertificateError("only some segments have feeds")
    around = scene or default_scene(problem.robot)
    pieces = _chained(motions)
    speeds = _speeds(motions, feeds)
    content: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        **(names or {}),
        "robot": robot_statement(problem.robot),
        "limits": limits_statement(problem),
        "motion": motion_statement(pieces, speeds),
    }
    bodies = scene_statement(problem.robot, around)
    content |= {} if bodies is None else {"scene": bodies}
    with precision(BITS):
        each = SeriesPieces(pieces)
        functions = slack_functions(problem, around, feeds=None if speeds is None else np.array(speeds))
        if all(proof.is_feasible for proof in proofs):
            content |= _feasible(problem, around, each, proofs)
        else:
            starts = itertools.accumulate((motion[-1].end for motion in motions[:-1]), initial=Fraction(0))
            cases = list(zip(proofs, map(float, starts), strict=True))
            content |= {"verdict": "infeasible", "failures": _failures(problem, around, each, cases, functions)}
    return content | {"sha256": digest(content)}


def digest(content: dict[str, Any]) -> str:
    """SHA-256 of a certificate without its key "sha256"."""
    rest = {key: value for key, value in content.items() if key != "sha256"}
    return hashlib.sha256(json.dumps(rest, sort_keys=True, separators=(",", ":")).encode("ascii")).hexdigest()


def _feasible(problem: Problem, scene: Scene, pieces: SeriesPieces, proofs: Sequence[MotionProof]) -> dict[str, Any]:
    # Bounds and blocks.
    rows = proofs[0].criteria
    largest = float(problem.robot.mass * problem.robot.gravity) + 1.0
    bounds = stated_bounds(rows, np.min([proof.proof.low for proof in proofs], axis=0), largest)
    return {
        "verdict": "feasible",
        "bounds": {name: _decimal(bound) for name, bound in zip(criterion_names(rows), bounds, strict=True)},
        "blocks": witnessed_blocks(problem, scene, pieces, rows, bounds),
    }


def _failures(
    problem: Problem,
    scene: Scene,
    pieces: SeriesPieces,
    cases: Sequence[tuple[MotionProof, float]],
    functions: Sequence[SlackFunction | None],
) -> list[dict[str, Any]]:
    # Failures that can be shown at single times, which need not be all of them; each proof has the time of its start.
    failures, left = list[dict[str, Any]](), list[NoCertificateError]()
    for proof, start in cases:
        names = criterion_names(proof.criteria)
        for k in np.flatnonzero(proof.broken).tolist():
            slack = NamedSlack(proof.criteria[k], names[k], functions[k] if k < len(functions) else None)
            try:
                failures.append(failure(problem, scene, pieces, slack, start + float(proof.proof.when[k])))
            except NoCertificateError as error:
                left.append(error)
    if not failures:
        raise left[0]
    return failures


def _decimal(bound: Fraction) -> str:
    # A rational number as a short decimal, if it is one.
    text = f"{float(bound):g}"
    return text if Fraction(text) == bound else str(bound)


def criterion_names(rows: Sequence[Criterion]) -> list[str]:
    """Names of criteria in certificates."""
    names, contacts = list[str](), 0
    floors = [k for k, row in enumerate(rows) if row.flag == Verdict.BELOW_FLOOR]
    for k, row in enumerate(rows):
        if row.flag in CONTACTS:
            names.append(f"contact:{contacts}")
            contacts += 1
        elif len(floors) > 1 and k == floors[-1]:
            names.append("lowest_below_floor")
        else:
            names.append(row.flag.text + "".join(f":{cable}" for cable in row.cables))
    return names


def _chained(motions: Sequence[list[MotionPiece]]) -> list[MotionPiece]:
    # Pieces of consecutive motions, each later by what lasts before it.
    pieces, start = list[MotionPiece](), 0 * motions[0][0].start
    for motion in motions:
        pieces += [piece._replace(start=piece.start + start, end=piece.end + start) for piece in motion]
        start = pieces[-1].end
    return pieces


def _speeds(motions: Sequence[list[MotionPiece]], feeds: Sequence[np.ndarray | None]) -> list[float] | None:
    # Largest speeds on all pieces; None without any.
    if not any(row is not None for row in feeds):
        return None
    each = [np.full(len(m), np.inf) if row is None else row for m, row in zip(motions, feeds, strict=True)]
    return np.concatenate(each).tolist()
