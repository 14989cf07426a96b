"""YAML of other programs: libyaml's loader where there is one, with limits on what a small text can expand to."""

from typing import Any

import yaml

_Base: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
# Enough for 1000 cables; Python's own loader takes some 100 us for an event, libyaml's some 5 us.
MAX_EVENTS = 300_000 if hasattr(yaml, "CSafeLoader") else 20_000
DEEPEST = 100
LONGEST_SCALAR = 10_000  # characters; the time to read integers of base 60 grows with the square of their length
MAX_ODD_KEYS = 1000  # largest number of keys that are not strings: numbers can be chosen so that their hashes collide
_WORD = "tag:yaml.org,2002:str"


class _Loader(_Base):
    """Safe loader that limits the pairs that merge keys (<<) copy."""

    pairs = 0

    def flatten_mapping(self, node: yaml.MappingNode) -> None:
        """Merge into a mapping what its merge keys refer to, within limits."""
        super().flatten_mapping(node)
        self.pairs += len(node.value)
        odd = sum(key.tag != _WORD for key, _ in node.value)
        if self.pairs > MAX_EVENTS or odd > MAX_ODD_KEYS:
            raise yaml.YAMLError("its mappings have too many keys")


def load(text: str) -> Any:
    """Value of a YAML text."""
    try:
        _check_events(text)
    except yaml.MarkedYAMLError as error:
        if "nesting depth" in str(error):  # libyaml has a limit too
            raise RecursionError from error
        raise
    return yaml.load(text, Loader=_Loader)


def _check_events(text: str) -> None:
    depth = 0
    for count, event in enumerate(yaml.parse(text, Loader=_Base)):
        is_end = isinstance(event, yaml.CollectionEndEvent)
        depth += isinstance(event, yaml.CollectionStartEvent) - is_end
        if depth > DEEPEST:
            raise RecursionError
        if count > MAX_EVENTS:
            raise yaml.YAMLError(f"it has more than {MAX_EVENTS} parts")
        if isinstance(event, yaml.ScalarEvent) and len(event.value) > LONGEST_SCALAR:
            raise yaml.YAMLError(f"a value of {len(event.value)} characters: must be at most {LONGEST_SCALAR}")
