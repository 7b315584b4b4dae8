"""What benchmarks share: figures with their aims and tables of them, how much is measured, byte code."""
