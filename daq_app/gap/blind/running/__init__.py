"""Diagnose cases in processes that are given nothing but their files."""
