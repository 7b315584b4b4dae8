"""NI's examples of its Python client, run as they are against the simulated device server."""
