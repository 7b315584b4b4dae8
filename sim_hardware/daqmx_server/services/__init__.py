"""NI's gRPC calls over the bench: attributes, life cycle, reads, events."""
