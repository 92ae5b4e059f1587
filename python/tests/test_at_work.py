"""Threads, signals, processes and memory."""

import os
import pickle
import shutil
import signal
import subprocess
import sys
import textwrap
import threading
import time

import numpy as np
import pytest

import bokehcam as bc

SIZE = (640, 360)


def frame(seed=0):
    rng = np.random.default_rng(seed)
    image = rng.integers(0, 256, (SIZE[1], SIZE[0], 3), dtype=np.uint8)
    coc = np.full(SIZE[::-1], 9, np.float32)
    coc[100:260, 200:400] = -6
    return image, coc


def test_other_python_threads_run_while_it_blurs():
    """With the GIL held, the other thread could run only just before and just after a picture."""
    image, coc = frame()[0], np.full(SIZE[::-1], 60, np.float32)
    # A picture takes a good part of a second, so that on a busy machine the other thread has its turns meanwhile, too.
    renderer = bc.Renderer(SIZE, method="gather", rank="full", max_coc_px=60, threads=1)
    ran_at, stop = [], threading.Event()

    def watch():
        while not stop.wait(0.001):
            ran_at.append(time.monotonic())

    other = threading.Thread(target=watch)
    other.start()
    try:
        executor, out = renderer._map_executor(), np.empty_like(image)
        began = time.monotonic()
        executor.blur(image, coc, out)
        took = time.monotonic() - began
    finally:
        stop.set()
        other.join()
    middle = [at for at in ran_at if 0.25 < (at - began) / took < 0.75]
    assert len(middle) > 3, (took, len(ran_at))


@pytest.mark.skipif(not os.path.isdir("/proc/self/task"), reason="threads are not listed")
def test_a_picture_takes_as_many_threads_as_wanted(portrait):
    """Its depth is refined on them, too."""
    names, done = set(), threading.Event()

    def watch():
        while not done.is_set():
            for task in os.listdir("/proc/self/task"):
                try:
                    with open(f"/proc/self/task/{task}/comm") as comm:
                        names.add(comm.read().strip())
                except OSError:
                    pass

    watcher = threading.Thread(target=watch)
    watcher.start()
    try:
        bc.render(np.tile(portrait.color, (3, 3, 1)), np.tile(portrait.depth, (3, 3)), refine="on", threads=1)
    finally:
        done.set()
        watcher.join()
    assert "bokehcam" in names and not [name for name in names if name.startswith("depth-")]


def test_threads_that_share_a_renderer_take_turns():
    renderer = bc.Renderer(SIZE, threads=2)
    frames = [frame(seed) for seed in range(4)]
    expected = [renderer(*each) for each in frames]
    wrong = []

    def work(k):
        for _ in range(5):
            if (renderer(*frames[k]) != expected[k]).any():
                wrong.append(k)

    threads = [threading.Thread(target=work, args=(k,)) for k in range(4)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert not wrong


def test_a_renderer_can_be_pickled():
    image, coc = frame()
    renderer = bc.Renderer(SIZE, bc.polygon(5, rim=0.1), "draft", 2, rank=3, max_coc_px=(10, 12))
    again = pickle.loads(pickle.dumps(renderer))
    assert repr(again) == repr(renderer)
    np.testing.assert_array_equal(again(image, coc), renderer(image, coc))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_renderer_works_in_a_forked_process():
    """Data loaders fork their workers; threads are not copied."""
    image, coc = frame()
    renderer = bc.Renderer(SIZE, threads=3)
    expected = renderer(image, coc)
    child = os.fork()
    if child == 0:
        signal.alarm(60)
        same = (renderer(image, coc) == expected).all() and (bc.blur(image, coc) == expected).all()
        os._exit(0 if same else 1)
    assert os.waitpid(child, 0)[1] == 0


def cpu_s(process):
    """Returns the processor time of a process that was not waited for yet, in seconds."""
    with open(f"/proc/{process}/stat") as stat:
        fields = stat.read().rpartition(")")[2].split()
    return sum(map(int, fields[11:13])) / os.sysconf("SC_CLK_TCK")


LONG = {
    "one picture": """
        image = np.zeros((1080, 1920, 3), np.uint8)
        coc = np.full((1080, 1920), 100, np.float32)
        work = lambda: bc.blur(image, coc, method="gather", rank="full", max_coc_px=120, threads=1)
    """,
    "a batch": """
        image = np.broadcast_to(np.zeros((720, 1280, 3), np.uint8), (300, 720, 1280, 3))
        work = lambda: bc.blur(image, np.full((720, 1280), 20, np.float32), quality="best", threads=1)
    """,
    "a pair": """
        image = np.random.default_rng(0).integers(0, 256, (4000, 6000, 3), dtype=np.uint8)
        work = lambda: bc.match(image, image, max_disparity=256, threads=1)
    """,
}


@pytest.mark.skipif(not os.path.exists("/proc/self/stat"), reason="processor times are not told")
@pytest.mark.parametrize("what", LONG)
def test_ctrl_c_ends_long_calls(what):
    """Each call would take half a minute or more."""
    text = "import numpy as np, bokehcam as bc, sys\n" + textwrap.dedent(LONG[what]) + textwrap.dedent("""
        print("begins", flush=True)
        try:
            work()
        except KeyboardInterrupt:
            print("interrupted", flush=True)
            # An interrupted call must not affect later ones.
            bc.blur(np.zeros((8, 8, 3), np.uint8), 2.0)
            print("goes on", flush=True)
    """)
    child = subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE, text=True)
    try:
        assert child.stdout.readline() == "begins\n"
        time.sleep(2)
        assert child.poll() is None
        # Time on the clock would also count what other programs of a busy machine take.
        before_s = cpu_s(child.pid)
        child.send_signal(signal.SIGINT)
        assert child.stdout.readline() == "interrupted\n"
        assert cpu_s(child.pid) - before_s < 15
        assert child.communicate(timeout=60)[0] == "goes on\n"
        assert child.returncode == 0
    finally:
        child.kill()


def test_a_renderer_is_whole_after_ctrl_c():
    image, coc = frame()
    renderer = bc.Renderer(SIZE, method="gather", rank="full", max_coc_px=100, threads=1)
    wide = np.full(SIZE[::-1], 90, np.float32)
    # Each row of a small picture takes a fraction of a second here, so that the alarm arrives in the middle of one.
    previous = signal.signal(signal.SIGALRM, lambda *_: (_ for _ in ()).throw(TimeoutError("alarm")))
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.5)
        with pytest.raises(TimeoutError, match="alarm"):
            renderer(image, wide)
            pytest.skip("this machine is faster than the alarm")
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, previous)
    fresh = bc.Renderer(SIZE, method="gather", rank="full", max_coc_px=100)
    np.testing.assert_array_equal(renderer(image[:, :], coc * 0.5), fresh(image, coc * 0.5))


COUNTER = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stddef.h>
static long large;
long large_allocations(void) { return large; }
static void count(size_t size) { if (size >= 2048) __atomic_add_fetch(&large, 1, __ATOMIC_RELAXED); }
extern void *__libc_malloc(size_t), *__libc_calloc(size_t, size_t), *__libc_realloc(void *, size_t);
extern void *__libc_memalign(size_t, size_t);
void *malloc(size_t size) { count(size); return __libc_malloc(size); }
void *calloc(size_t n, size_t size) { count(n * size); return __libc_calloc(n, size); }
void *realloc(void *old, size_t size) { count(size); return __libc_realloc(old, size); }
void *aligned_alloc(size_t to, size_t size) { count(size); return __libc_memalign(to, size); }
int posix_memalign(void **out, size_t to, size_t size) { count(size); *out = __libc_memalign(to, size); return *out ? 0 : 12; }
"""

COUNTED = """
import ctypes, sys, numpy as np, bokehcam as bc
large = ctypes.CDLL(sys.argv[1]).large_allocations
large.restype = ctypes.c_long
before = large()
kept = np.ones(1 << 20)
assert large() > before, "nothing is counted"
for dtype in (np.uint8, np.float32):
    image = np.random.default_rng(0).integers(0, 2, (360, 640, 3)).astype(dtype)
    out = np.empty_like(image)
    maps = [np.full((360, 640), 12, np.float32), np.linspace(-9, 20, 640 * 360, dtype=np.float32).reshape(360, 640)]
    renderer = bc.Renderer((640, 360), threads=2)
    for coc in maps + [6.0]:
        renderer(image, coc, out=out)
    before = large()
    for _ in range(20):
        for coc in maps + [6.0]:
            renderer(image, coc, out=out)
    print(dtype.__name__, large() - before)
"""


def test_a_renderer_allocates_nothing_from_picture_to_picture(tmp_path):
    """Allocations are counted by a preloaded malloc; Python's own objects are below its threshold."""
    compiler = shutil.which("cc")
    if compiler is None or not sys.platform.startswith("linux"):
        pytest.skip("counting takes a C compiler and glibc")
    (tmp_path / "counter.c").write_text(COUNTER)
    library = tmp_path / "counter.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", library, tmp_path / "counter.c", "-ldl"], check=True)
    environment = os.environ | {"LD_PRELOAD": str(library)}
    done = subprocess.run(
        [sys.executable, "-c", COUNTED, library], env=environment, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["uint8", "0", "float32", "0"]
