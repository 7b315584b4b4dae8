"""What is wrong with sensors while they are sampled: overloads, ends of travel, doubtful channels."""
