"""The page about a result file; `study.show.report.writing` makes it, the other modules each make a part."""
