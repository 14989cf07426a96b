"""Why cells of a published table differ from the computed ones, and which reading of the source fits its numbers."""

from typing import NamedTuple

from cspr_jax.outputs.table_layout import Cell


class Reason(NamedTuple):
    """Why some cells differ: an error of the source, or a choice that the source does not state.

    Fields:
        text: one line.
        rows: rows of these cells; empty: any row.
        columns: columns of these cells; empty: any column.
        variant: part of the name of the variants of these cells.
    """

    text: str
    rows: tuple[str, ...] = ()
    columns: tuple[str, ...] = ()
    variant: str = ""

    def covers(self, cell: Cell) -> bool:
        """Tell whether the reason is about a cell."""
        is_there = (not self.rows or cell.row in self.rows) and (not self.columns or cell.column in self.columns)
        return is_there and self.variant in cell.variant


# For each table, the variant that fits the printed numbers best.
READINGS = {
    "1.3": "w_max = 5 sqrt(3)",
    "3.2": "amplitude = effective-c3 0.1; pose_2 = pi/3",
    "4.2": "exact T and p",
    "4.3": "boundaries of five decimals",
}
_COUNTS = "the counts depend on how orientations are counted, and no reading of the text gives the printed ones"
_PROPORTIONS = (
    "proportions depend on the amplitude function (see Table 3.2), and on the arcs and values of beta-hat that are "
    "tried, which the text does not say"
)
# The first reason that covers a cell applies. The errors of the sources are listed in docs/sources.md.
REASONS: dict[str, tuple[Reason, ...]] = {
    "1.2": (
        Reason(
            "erratum: the printed inclination is the best for 1,001 samples of time; n is flat there and differs by "
            "1e-6 only, while n at the opposite inclination changes with it",
            ("A1",),
        ),
        Reason("misprint: A2 at v = 0 is 1.19", ("A2",)),
    ),
    "1.3": (
        Reason("misprint: an epsilon of 0.0399 cannot give the printed n, 0.0599 does", ("epsilon",), (), "5 sqrt(3)"),
        Reason(
            "erratum: the caption names a distance whose w_max is 10; the printed numbers belong to 5 sqrt(3), a "
            "distance along H_0"
        ),
    ),
    "3.2": (
        Reason(
            "erratum of Table 3.1: pose 2 as printed, with a torsion of pi/2, can neither be reached nor left with the "
            "printed arcs; with pi/3 it can",
            ("1", "2"),
            (),
            "pi/2",
        ),
        Reason(
            "erratum: the text names the quintic, with which the printed arcs of these segments are not feasible; the "
            "piecewise function of chapter 1, (1.110), and its smooth relative give them",
            ("0", "4", "5", "6"),
            (),
            "quintic",
        ),
        Reason("fewer arcs than printed are found feasible", ("5",)),
    ),
    "3.3": (Reason(_COUNTS, (), ("accessible", "attainable")), Reason(_PROPORTIONS, (), ("proportion",))),
    "3.4": (Reason(_PROPORTIONS),),
    "4.1": (Reason("misprint: the two imaginary solutions are printed with the sign of p exchanged"),),
    "4.2": (
        Reason("-1.752 follows from the printed T and p, of three decimals", (), (), "exact"),
        Reason("0.896 follows from exact T and p", (), (), "three decimals"),
    ),
    "4.3": (
        Reason(
            "erratum: the optimum T that the text names, 4.35 s, contradicts the source's own table, where the first "
            "node without overshoot is 4.40 s",
            ("search",),
        ),
        Reason(
            "the source must have rounded the boundaries to five decimals: so rounded, all numbers of the grid agree",
            (),
            (),
            "exact",
        ),
    ),
}


def reason_of(table: str, cell: Cell) -> str:
    """Why a cell differs."""
    return next((reason.text for reason in REASONS.get(table, ()) if reason.covers(cell)), "")
