"""Every byte of a run file under a hash: the seal, its signature, and reading only what is proven."""
