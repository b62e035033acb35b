"""The page about a result file; `study.report.writing` makes it, the other modules each make a part."""
