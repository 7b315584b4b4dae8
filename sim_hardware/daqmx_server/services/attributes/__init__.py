"""Attributes that the client gets, sets and resets, by the object that has them."""
