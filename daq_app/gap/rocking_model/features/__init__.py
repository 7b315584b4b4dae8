"""Features of one run, one file per sensor family: observation, prediction, sizes and priors."""
