"""What benchmarks share: a figure with its aim, tables of figures, byte code for programs that are timed."""
