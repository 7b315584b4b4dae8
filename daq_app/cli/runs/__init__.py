"""Commands on recorded runs: verify, recover, export, import."""
