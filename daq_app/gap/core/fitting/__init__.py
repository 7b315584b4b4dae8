"""From a hypothesis to its fit: likelihood with estimated discrepancy, search, held-out runs."""
