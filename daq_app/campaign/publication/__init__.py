"""A campaign as a folder that a repository takes as it is: data, tables, figures, metadata, checksums."""
