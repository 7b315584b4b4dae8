"""``python -m benchmarks.soak --minutes 60 --seed 3``: see `studies.recording.soak_tests`.

The name under which a lab looks for it; what it asks (is anything ever lost) is a question of `studies`.
"""

from __future__ import annotations

import sys

from studies.recording.soak_tests import main

if __name__ == "__main__":
    sys.exit(main())
