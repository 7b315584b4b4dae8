"""Small pieces of the window: tables, banners, cards, entries, and what the operator can order."""
