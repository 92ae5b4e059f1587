"""What takes long to start is started once."""

from __future__ import annotations

import pytest

from farm_fixtures import Cluster


@pytest.fixture(scope="session")
def cluster():
    """Two nodes of Ray's on this machine, with a core each."""
    made = Cluster()
    try:
        made.add()
        yield made
    finally:
        made.stop()
