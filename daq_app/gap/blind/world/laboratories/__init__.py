"""Laboratories as data: which ordinary imperfections their recordings have, and how large they are."""
