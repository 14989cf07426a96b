"""Check a file: `python -m cspr_jax.certificate_checker FILE`."""

import sys
from pathlib import Path

from cspr_jax.certificate_checker.checking import check
from cspr_jax.certificate_checker.reading import read


def main(paths: list[str]) -> int:
    """Print one line; return 0 if the certificate holds, 2 if it is none, 5 if its proof does not hold."""
    try:
        finding = check(read(Path(*paths).read_bytes().decode()))
    except (OSError, ValueError) as error:
        sys.stdout.write(f"no certificate: {error}\n")
        return 2
    sys.stdout.write(f"{'holds' if finding.holds else 'does not hold'}: {finding.message}\n")
    return 0 if finding.holds else 5


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
