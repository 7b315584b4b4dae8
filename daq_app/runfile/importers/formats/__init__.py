"""One module for each foreign file format."""
