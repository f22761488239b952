"""Report: one page of HTML that shows what a finished dataset holds."""
