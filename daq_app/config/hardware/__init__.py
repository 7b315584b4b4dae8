"""What hardware there is: products, modules in slots, what is wired to each terminal."""
