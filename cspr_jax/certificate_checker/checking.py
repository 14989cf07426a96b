"""The verdict: all bounds hold on all blocks, or the failures are real."""

from bisect import bisect_right
from collections import namedtuple
from collections.abc import Iterator
from functools import partial
from itertools import chain, combinations, pairwise
from threading import Lock
from typing import Any

from flint import arb, ctx, fmpq

from cspr_jax.certificate_checker.criteria import Criterion, criteria, crossing, hull, margins
from cspr_jax.certificate_checker.reading import Fields, check_order, parse, read_statement, refuse
from cspr_jax.certificate_checker.series import ORDER, Undefined, dot, plus, term, tight
from cspr_jax.certificate_checker.state import State

MAX_PARTS, MAX_DEPTH = 4096, 100  # parts of a block, each a half of a half and so on
MAX_WORK = 200_000_000  # steps of all states of a file
SAME, SAME_TIME = fmpq(1, 10**8), fmpq(1, 100)  # where pieces meet: m, entries of rotations, and m/s times s
LOCK = Lock()  # ctx is that of the whole process
FILE = dict.fromkeys(["format", "verdict", "sha256", "name?", "note?"], "text")
FILE |= dict.fromkeys(["version", "robot", "limits", "motion", "scene?"], "any")
Finding = namedtuple("Finding", "holds message")  # whether the proof holds, and a line that says so


def check(content: Any) -> Finding:
    """Check all that a file states, apart from its checksum; raises NotACertificate if its form is wrong."""
    feasible = isinstance(content, dict) and content.get("verdict") == "feasible"
    parse(content, FILE | dict.fromkeys(["bounds", "blocks"] if feasible else ["failures"], "any"), "file", {})
    right = content["format"] == "cspr-certificate" and type(content["version"]) is int and content["version"] == 1
    refuse(not right, "format, version: not those of cspr-certificate, version 1")
    refuse(content["verdict"] not in ("feasible", "infeasible"), "verdict: neither feasible nor infeasible")
    with LOCK, ctx.workprec(512):
        cap, ctx.cap = ctx.cap, ORDER
        try:
            case = read_statement(content)
            message, doubts = (_feasible if feasible else _infeasible)(content, case, dict(criteria(case)))
            doubt = next(chain(_gaps(case), doubts), "")
        finally:
            ctx.cap = cap
        limits = [f"contacts of {len(case['pairs'])} pairs"] if case["pairs"] else []
        for name, limit in case["limits"].items():
            values = limit if isinstance(limit, list) else [limit]
            limits.append(f"{name} {' to '.join(dict.fromkeys(f'{float(arb(f(values))):g}' for f in (min, max)))}")
    return Finding(not doubt, f"{content['verdict']}, {doubt or message}; limits: {', '.join(limits)}")


def _feasible(content: Fields, case: Fields, named: dict[str, Criterion]) -> tuple[str, Iterator[str]]:
    """Return a message and doubts; raises NotACertificate."""
    bounds = parse(content["bounds"], dict.fromkeys(named, "number"), "bounds", {})
    for name, bound in bounds.items():
        refuse(bound < 0 and bound**2 > named[name].allowance_squared, f"bounds.{name}: below the allowance")
    sizes, starts = {**case["sizes"], "pairs": len(case["pairs"])}, [piece["start"] for piece in case["pieces"]]
    table = {"start": "number", "end": "number"} | ({"directions": "number pairs 3"} if case["pairs"] else {})
    table |= {"tensions": "number 2 n"} if sizes["n"] > sizes["d"] else {}
    blocks = parse(content["blocks"], (table, "+"), "blocks", sizes)
    check_order(blocks, "blocks", case["duration"])
    pieces = [case["pieces"][bisect_right(starts, block["start"]) - 1] for block in blocks]
    for k, (piece, block) in enumerate(zip(pieces, blocks, strict=True)):
        refuse(block["end"] > piece["end"], f"blocks[{k}]: not within one piece")
        refuse(not all(map(any, block.get("directions", []))), f"blocks[{k}].directions: a vector is zero")
    claims = [(name, named[name], bound) for name, bound in bounds.items()]
    doubts = (_doubts(case, *entry, claims, f"blocks[{k}]") for k, entry in enumerate(zip(pieces, blocks, strict=True)))
    return f"{len(bounds)} criteria hold on {len(blocks)} blocks", chain.from_iterable(doubts)


def _infeasible(content: Fields, case: Fields, named: dict[str, Criterion]) -> tuple[str, Iterator[str]]:
    """Return a message and doubts; raises NotACertificate."""
    failures = parse(content["failures"], (partial(_failure, case, named), "+"), "failures", case["sizes"])
    texts = [f"{failure['criterion']} at {float(arb(failure['time'])):g} s" for failure in failures]
    defined, pieces = ("that it is defined", Criterion(0, 0, lambda _: []), 0), case["pieces"]
    doubts = (_doubts(case, piece, piece, [defined], f"motion.pieces[{k}]") for k, piece in enumerate(pieces))
    real = (any(_fails(case, piece, entry) for piece in entry["pieces"]) for entry in failures)
    unreal = (f"{text} is not shown" for text, is_real in zip(texts, real, strict=True) if not is_real)
    return f"fails: {', '.join(texts[:8])}{', ...' * (len(texts) > 8)}", chain(chain.from_iterable(doubts), unreal)


def _state(case: Fields, piece: Fields, block: Fields, time: Any, radius: Any) -> State:
    """Return a state; raises NotACertificate once those of a file have been too much work."""
    case["work"] += piece["work"]
    refuse(case["work"] > MAX_WORK, f"the proof: of more than {MAX_WORK} steps")
    return State(case["robot"], piece, block, time, radius)


def _gaps(case: Fields) -> Iterator[str]:
    """Name pieces that do not meet within the tolerances, to which the jumps before count too."""
    sums: list[Any] = []
    for k, (one, two) in enumerate(pairwise(case["pieces"])):
        try:
            first, second = (_state(case, piece, piece, two["start"], fmpq(0)) for piece in (one, two))
            turns = zip(chain(*first.rotation), chain(*second.rotation), strict=True)
            jumps = [plus(first.position, second.position, -1), *([a - b] for a, b in turns)]
            rates = [[entry.derivative() * SAME_TIME for entry in jump] for jump in jumps]
            sizes = [term(dot(gap, gap)).abs_upper().sqrt() for gap in jumps + rates]
            sums = plus(sizes, sums or [0] * len(sizes))
            if not all(total <= SAME for total in sums):
                yield f"motion.pieces[{k}] and the next do not meet"
        except Undefined:
            yield f"motion.pieces[{k}] or the next is not defined where they meet"


def _doubts(case: Fields, piece: Fields, block: Fields, claims: list[Any], name: str) -> Iterator[str]:
    """Cut a block into parts until all claims are shown; name one that is not."""
    parts, pending = 1, [(block["start"], block["end"], 0, claims)]
    while pending:
        start, end, depth, left = pending.pop()
        middle = (start + end) / 2
        with ctx.workprec(64 + 8 * depth):
            try:
                state = _state(case, piece, block, middle, (end - start) / 2)
                left = [claim for claim in left if not _shown(state, *claim[1:])]
            except Undefined:
                pass
        if left and (parts == MAX_PARTS or depth == MAX_DEPTH):
            yield f"{name}: {left[0][0]} is not shown"
            return
        if left:
            parts += 1
            pending += [(middle, end, depth + 1, left), (start, middle, depth + 1, left)]


def _shown(state: State, criterion: Criterion, bound: Any) -> bool:
    """Say that balls show a slack to exceed a bound at all times of a state."""
    try:
        over = margins(criterion, state, bound)
        if all(term(margin) > 0 for margin in over):
            return True
        pairs = zip(margins(criterion, state.middle or state, bound), over, strict=True)
        return all(term(tight(*pair, state.radius)) > 0 for pair in pairs)
    except Undefined:
        return False


def _failure(case: Fields, named: dict[str, Criterion], value: Any, key: str, sizes: dict[str, int]) -> Fields:
    """Read a failure with its witness."""
    name: Any = value.get("criterion") if isinstance(value, dict) else None
    refuse(not isinstance(name, str) or name not in named, f"{key}.criterion: none of this statement")
    pair = case["pairs"][int(name[8:])] if name.startswith("contact:") else []
    contact = {"until": "number"} if "until" in value else {"points": ("nonnegative +", "2")}
    table: Fields = {"criterion": "text", "time": "number"} | (contact if pair else {})
    failure = parse(value, table | ({"wrench": "number d"} if name == "wrench_infeasible" else {}), key, sizes)
    start, end = failure["time"], failure.get("until", failure["time"])
    pieces = [piece for piece in case["pieces"] if piece["start"] <= start <= end <= piece["end"]]
    refuse(not pieces, f"{key}: not in the motion, or not within one piece")
    segments = (len(body.get("points", [])) == 2 or (body["kind"] == "cable" and not body["turns"]) for body in pair)
    right = all(segments) or {body["kind"] for body in pair} == {"cone", "spool"}
    refuse("until" in failure and not (start < end and right), f"{key}.until: too early, or of other bodies")
    return {**failure, "start": start, "end": end, "pieces": pieces, "named": named[name], "pair": pair}


def _crosses(case: Fields, piece: Fields, failure: Fields, rays: tuple[int, int]) -> bool:
    """Say that balls show segments, or a spool and two rays of a cone, to pass each other; raises Undefined."""
    pair = failure["pair"]
    ends = [crossing(_state(case, piece, piece, failure[key], fmpq(0)), pair, rays) for key in ("start", "end")]
    within = all(term(value) < 0 for end in ends for value in end[1:])
    sides = pair[0]["flat"] or term(ends[0][0]) * term(ends[1][0]) < 0
    touching = Criterion(0, 0, lambda state: crossing(state, pair, rays)[1:])
    return sides and within and not any(_doubts(case, piece, failure, [("", touching, 0)], ""))


def _fails(case: Fields, piece: Fields, failure: Fields) -> bool:
    """Say that balls show a slack in a piece to be less than minus its allowance, or bodies to touch in between."""
    allowance, pair, limits = arb(failure["named"].allowance_squared).sqrt(), failure["pair"], case["limits"]
    try:
        if "until" in failure:
            count = next((len(body["cone"]) for body in pair if "cone" in body), 2)
            return any(_crosses(case, piece, failure, rays) for rays in combinations(range(count), 2))
        state = _state(case, piece, piece, failure["time"], fmpq(0))
        if pair:
            ends = []
            for body, stated in zip(pair, failure["points"], strict=True):
                points, cone = hull(state, body), body["kind"] == "cone"
                weights = [fmpq(1), *stated] if cone else stated
                right = len(points) == len(weights) and (cone or sum(stated) == 1)
                refuse(not right, "failures: points: not a weight for each point, or their sum is not 1")
                ends.append([dot(weights, column) for column in zip(*points, strict=True)])
            gap = plus(ends[0], ends[1], -1)
            return bool(term(dot(gap, gap)) < sum(body["radius"] for body in pair) ** 2)
        if "wrench" not in failure:
            return any(term(margin) < 0 for margin in margins(failure["named"], state, -allowance))
        y, largest = failure["wrench"], arb(0)  # by Farkas' lemma
        highest = limits.get("tension_max", [arb.pos_inf()] * case["sizes"]["n"])
        for i, (low, high) in enumerate(zip(limits["tension_min"], highest, strict=True)):
            product = term(dot(y, state.columns[i * len(y) : (i + 1) * len(y)]))
            largest += (product * (low - allowance)).max(product * (high + allowance))
        return bool(term(dot(y, state.wrench)) > largest)
    except Undefined:
        return False
