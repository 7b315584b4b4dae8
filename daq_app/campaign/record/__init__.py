"""The test record: one document per test, to be printed, signed and filed."""
