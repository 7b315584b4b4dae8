"""The run as an HDF5 file: layout of channels, writing, guarded reading."""
