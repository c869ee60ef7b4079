"""Which lines of the package each test runs, in a process that has imported none of it."""

import signal
import time
from pathlib import Path

import coverage
import pytest

SECONDS = 120.0
"""Processor time after which a test is not asked: a trial is to be cheap."""
ALTOGETHER = 300.0
"""Processor time for a file of tests."""


class Watch:
    """A plugin of pytest that keeps lines and processor time [s] of every test that passes."""

    def __init__(self, folder: Path):
        self.folder, self.seconds, self.passed, self.wrong = folder, {}, set(), set()
        source = [str(folder / "camopt")]
        self.coverage = coverage.Coverage(data_file=None, config_file=False, source=source, messages=False)
        signal.signal(signal.SIGPROF, lambda *_: pytest.fail("takes too long to be asked"))
        self.coverage.start()

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item):
        """Lines that run from here on are this test's."""
        if time.process_time() > ALTOGETHER:
            item.session.shouldstop = "enough tests of one file"
        self.coverage.switch_context(item.nodeid)
        start = time.process_time()
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        yield
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        self.coverage.switch_context("")
        self.seconds[item.nodeid] = round(time.process_time() - start, 3)

    def pytest_runtest_logreport(self, report):
        """A test that is skipped, fails or takes too long is not asked."""
        if report.when == "call" and report.passed:
            self.passed.add(report.nodeid)
        elif not report.passed:
            self.wrong.add(report.nodeid)

    def found(self) -> dict[str, dict]:
        """For each test its seconds and the lines by file."""
        self.coverage.stop()
        data = self.coverage.get_data()
        tests = {t: {"seconds": self.seconds[t], "lines": {}} for t in sorted(self.passed - self.wrong)}
        for path in sorted(data.measured_files()):
            name = Path(path).relative_to(self.folder).as_posix()
            for line, contexts in data.contexts_by_lineno(path).items():
                for test in tests.keys() & set(contexts):
                    tests[test]["lines"].setdefault(name, []).append(line)
        return tests
