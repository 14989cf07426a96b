"""`python -m cspr_jax`."""

import sys

from cspr_jax.cli import main

sys.exit(main())
