"""A designer's server in a thread, for the tests of the server and the page."""

from contextlib import ExitStack

import pytest

from tests.campaign.messages import served


@pytest.fixture(scope="session")
def serve():
    """Function that serves a scene from a folder; all servers end with the session."""
    with ExitStack() as every:
        yield lambda scene, folder: every.enter_context(served(scene, folder))
