"""Tables, figures, the ledger that sets the paper's numbers beside ours, and one self-contained HTML page.

Everything here is a pure function of the files that stages wrote: the same inputs give the same bytes. Entry point:
`pipeline.report.build.build`, which writes the whole report from `pipeline.report.inputs.ReportInputs`.
"""
