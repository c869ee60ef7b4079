"""The report page of a run folder."""

from camopt.report.page import write_report

__all__ = ["write_report"]
