"""Recorder and live monitor for free-rocking tests of stone-masonry walls."""
