"""What the gap's tests diagnose: recordings from elsewhere, simulated campaigns, a small model."""
