"""Housner's block and the classic closed forms. Equations only; no recordings."""
