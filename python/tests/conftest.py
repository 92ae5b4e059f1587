"""Fixtures: the repository's recordings, the built program, and a scene with its truth."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import bokehcam as bc

sys.path.insert(0, str(Path(__file__).parent))

from farm_fixtures import Cluster  # noqa: E402

# Background jobs of a script ignore Ctrl-C, and the tests' child processes would, too.
signal.signal(signal.SIGINT, signal.default_int_handler)

REPOSITORY = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def repository():
    return REPOSITORY


@pytest.fixture(scope="session")
def recordings():
    return REPOSITORY / "recordings"


@pytest.fixture(scope="session")
def portrait(recordings):
    """The first frame of the bundled recording: a room, a sitter, a twig in front; its depth has no holes."""
    return bc.Recording(recordings / "portrait")[0]


@pytest.fixture(scope="session")
def scene():
    """A scene with an object in front of the focal plane."""
    return bc.thin_lens_scene(5, (192, 108), samples=96)


@pytest.fixture(scope="session")
def program(tmp_path_factory):
    """Runs the built `bokehcam` in a separate folder, without the user's settings."""
    path = os.environ.get("BOKEHCAM_PROGRAM")
    if not path:
        pytest.skip("BOKEHCAM_PROGRAM does not name the program (python/test does)")
    home = tmp_path_factory.mktemp("home")
    environment = {name: value for name, value in os.environ.items() if not name.startswith("BOKEHCAM_")}
    # Without the networks beside a program that was built.
    environment |= {"HOME": str(home), "XDG_CONFIG_HOME": str(home), "BOKEHCAM_MODELS": os.devnull}

    def run(*arguments):
        words = [path, *map(str, arguments)]
        done = subprocess.run(words, env=environment, cwd=home, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, f"{words}: {done.stderr}"
        return done

    return run


@pytest.fixture(scope="session")
def cluster():
    """Two Ray nodes on this machine, with one core each."""
    made = Cluster()
    try:
        made.add()
        yield made
    finally:
        made.stop()
