"""Names inside a run file, kept in one place for writer and reader (docs/reference/run-format.md)."""

from __future__ import annotations

from typing import Final

RAW: Final = "raw"
SI: Final = "si"
DERIVED: Final = "derived"
EVENTS: Final = "events"
GAPS: Final = "gaps"
CHANNELS: Final = "channels"
CHECKS: Final = "checks"
INTEGRITY: Final = "integrity"
SEAL: Final = "seal"
TIME: Final = "time"
HEADER_JSON: Final = "header_json"
RIG_TOML: Final = "rig_toml"
PLAN_JSON: Final = "plan_json"
TRUTH_JSON: Final = "truth_json"
RESULTS_JSON: Final = "results_json"
CONVENTIONS: Final = "CF-1.11"
