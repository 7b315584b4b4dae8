"""The report of a campaign: what was collected, tables, figures, HTML and PDF."""
