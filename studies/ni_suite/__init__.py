"""NI's own test suite of its Python client, run against the simulated device server."""
