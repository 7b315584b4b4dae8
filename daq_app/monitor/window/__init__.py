"""The main window around the pages: navigation, orders, settings, start."""
