"""The wall as a rigid body of a contact engine."""
