"""How viewers reach the acquisition process: sockets, keys, client, launcher."""
