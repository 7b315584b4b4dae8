"""When samples are taken: clocks, triggers, routes, runs."""
