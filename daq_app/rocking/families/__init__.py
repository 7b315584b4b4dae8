"""What each sensor family says of one motion, who disagrees with whom, and what that usually means."""
