"""A designer in a thread, for the tests of its server and of its page."""

from contextlib import ExitStack

import pytest

from tests.campaign.messages import served


@pytest.fixture(scope="session")
def serve():
    """Serves a scene from a folder; everything ends with the session."""
    with ExitStack() as every:
        yield lambda scene, folder: every.enter_context(served(scene, folder))
