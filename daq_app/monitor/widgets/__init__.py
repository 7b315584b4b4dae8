"""Small pieces of the window: labels, tables, banners, gauges, the theme."""
