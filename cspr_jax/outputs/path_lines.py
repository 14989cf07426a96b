"""Lines below the table of a plan about its paths: what binds, what ramps cost, and bounds of whole sections."""

from typing import Any

# Limits that a line names, at most; smaller shares of the time than this it leaves out.
MOST_NAMED, LEAST_NAMED = 4, 0.005


def path_lines(segments: list[dict[str, Any]]) -> list[str]:
    """Lines about paths, in the order of the segments."""
    lines = []
    for segment in segments:
        sections, words = segment["sections"] or [], []
        if segment["binding"]:
            words.append(f"binds: {_binding(segment['binding'])}")
        words += _of_sections(sections, segment["to"])
        if words:
            lines.append(f"to {segment['to']}: {'; '.join(words)}")
    return lines


def _binding(rows: list[dict[str, Any]]) -> str:
    texts = [
        f"{row['words']} ({_percent(row['share'])})"
        for row in rows[:MOST_NAMED]
        if row["share"] >= LEAST_NAMED or row is rows[0]
    ]
    return ", ".join(texts).replace(")", " of the time)", 1)


def _of_sections(sections: list[dict[str, Any]], to: int) -> list[str]:
    ridden = [section for section in sections if section["ramp_time"] is not None]
    words = [] if len(ridden) == len(sections) else ["no fastest motion, the numbers are those of a slow one"]
    for section in ridden:
        first = section["segments"][0]
        if first < to - 1 and section["lower_bound"] is not None:
            bound, gap = section["lower_bound"], _percent(section["gap"])
            words.append(f"from {first}: {section['duration']:.4f} s, at least {bound:.4f} s, gap {gap}")
    with_ramps = [section for section in ridden if section["ramp_cost"] is not None]
    if with_ramps:
        total = sum(section["duration"] for section in with_ramps)
        without = sum(section["duration"] / (1.0 + section["ramp_cost"]) for section in with_ramps)
        times = sorted({float(f"{section['ramp_time']:.4g}") for section in with_ramps})
        length = " to ".join(f"{time:g}" for time in dict.fromkeys((times[0], times[-1])))
        words.append(f"ramps of {length} s cost {_percent(total / without - 1.0)}")
    speeds = [section["least_speed"] for section in ridden if section["least_speed"]]
    return words + ([f"somewhere it must be as fast as {max(speeds):.3g} m/s"] if speeds else [])


def _percent(fraction: float) -> str:
    return f"{100.0 * fraction:.2g} %" if fraction < 0.1 else f"{100.0 * fraction:.0f} %"
