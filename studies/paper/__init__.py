"""Every number of the paper's tables beside ours."""
