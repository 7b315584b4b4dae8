"""Virtual channels: what a request makes of a physical channel, and how readings are scaled."""
