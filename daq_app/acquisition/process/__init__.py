"""The acquisition process: hardware, session and sockets under one roof."""
