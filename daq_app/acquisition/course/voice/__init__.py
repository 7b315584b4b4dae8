"""What the recorder says of the test: the state, the countdown of a steady hold, and one judgement."""
