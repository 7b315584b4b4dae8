"""The core of the gap diagnosis on real public recordings whose missing effect is known.

``python -m studies.real_gap.emps`` and ``python -m studies.real_gap.pendulum`` print tables;
with ``--pictures DIR`` they write figures.
"""
