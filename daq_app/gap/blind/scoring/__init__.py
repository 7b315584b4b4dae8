"""Results against labels: what was right, and the tables and pages that say so."""
