"""From fits to an answer: hypotheses and their probabilities, what remains, the decision in words."""
