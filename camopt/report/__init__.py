"""The report page of a run folder; nobody in the package imports this but the command line."""

from camopt.report.page import write_report

__all__ = ["write_report"]
