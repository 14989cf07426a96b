"""`python -m cspr_jax`.

Python itself puts the working folder before the standard library for `-m`, and has looked there before this file runs.
From here on nothing is found there any more, here or in worker processes; the script `cspr` never looks there.
"""

import os
import sys

if sys.path[:1] == [os.getcwd()] != [os.path.dirname(os.path.dirname(os.path.abspath(__file__)))]:
    del sys.path[0]

from cspr_jax.cli import main

sys.exit(main())
