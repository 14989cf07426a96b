"""Table of rules that choose tensions where cables are redundant; no jax here: files name them."""

from typing import NamedTuple

CENTRED = "centred"  # default rule of plans


class TensionRule(NamedTuple):
    """A rule that chooses tensions.

    Fields:
        name: name in files and in calls.
        sentence: description of the tensions that it finds.
        is_bounded: whether every cable needs a largest tension.
        is_exact: whether it finds feasible tensions wherever there are any.
    """

    name: str
    sentence: str
    is_bounded: bool
    is_exact: bool


TENSION_RULES = {
    rule.name: rule
    for rule in (
        TensionRule("least-norm", "the feasible tensions whose sum of squares is the least", False, True),
        TensionRule(CENTRED, "the tensions farthest from their limits, of these the least", False, True),
        TensionRule("closed-form", "the nearest to the middles of their ranges, whatever the limits", True, False),
        TensionRule(
            "improved-closed-form",
            "the closed form, repeatedly fixing at its limit the cable that violates it most",
            True,
            False,
        ),
        TensionRule("p-norm", "the feasible tensions of the least p-norm about a reference", False, True),
    )
}
