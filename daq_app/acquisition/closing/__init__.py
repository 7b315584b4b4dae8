"""From a closed journal to a run file with results, in a process of its own."""
