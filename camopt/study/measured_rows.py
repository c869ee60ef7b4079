"""Rows of measurements that outlive an interruption: what `camopt tradeoff` and `camopt extremes` write."""

from collections.abc import Callable, Sequence

from tqdm import tqdm

from camopt.storage.journal import Records

COLUMNS = ("case", "method", "setting", "error", "error_of", "seconds", "converged", "verdict")
"""Columns of tradeoff.csv and extremes.csv."""
REFERENCE = "reference"
"""The method of a case's reference, against which the errors of all others are taken."""
Measurement = tuple[tuple[str, ...], Callable[[], dict]]
"""The values of the journal's names, case and method first, and what gives the rest of the record."""


def measured(journal: Records, work: Sequence[Measurement], progress: bool = False) -> list[dict]:
    """The records of all measurements, in the order of `work`; those that the journal holds are not made again."""
    records = []
    with tqdm(work, disable=None if progress else True, unit="measurement", dynamic_ncols=True) as bar:
        for key, run in bar:
            bar.set_description(": ".join(key[:2]))
            if journal.get(*key) is None:
                journal.add(dict(zip(journal.names, key, strict=True)) | run())
            records.append(journal.get(*key))
    return records
