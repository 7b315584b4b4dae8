"""What travels between threads and to viewers: items, published messages, options of the process."""
