"""The blur as a step of a Ray Data pipeline: the same pictures as without Ray, by cached renderers."""

from __future__ import annotations

import importlib.util
import json
import pickle
import subprocess
import sys

import bokehcam as bc
import numpy as np
import pytest
from bokehcam import ray as steps
from farm_fixtures import environment

SIZE = (40, 30)
has_ray_data = all(importlib.util.find_spec(name) for name in ("ray", "pyarrow", "pandas"))


def pictures(count: int, size: tuple[int, int] = SIZE) -> np.ndarray:
    return np.random.default_rng(count).integers(0, 256, (count, size[1], size[0], 3), np.uint8)


def test_a_batch_is_blurred_as_its_pictures_are():
    batch = {"image": pictures(3), "coc": np.linspace(-1.5, 1.5, 3 * 40 * 30, dtype=np.float32).reshape(3, 30, 40)}
    lens = bc.Renderer(SIZE, "polygon:6", threads=1)
    expected = [lens(image, coc) for image, coc in zip(*batch.values())]
    by_column = steps.Blur(aperture="polygon:6")(batch)
    np.testing.assert_array_equal(by_column["image"], expected)
    np.testing.assert_array_equal(by_column["coc"], batch["coc"])
    by_function = steps.Blur(lambda row: row["coc"], aperture=bc.polygon(6), out="blurred")(batch)
    np.testing.assert_array_equal(by_function["blurred"], expected)
    assert by_function["image"] is batch["image"]
    np.testing.assert_array_equal(steps.Blur(1.5)({"image": pictures(2)})["image"], bc.blur(pictures(2), 1.5))


def test_pictures_of_several_sizes_are_an_array_of_arrays():
    images = np.empty(2, dtype=object)
    images[:] = [pictures(1)[0], pictures(1, (24, 20))[0]]
    result = steps.Blur(2.0)({"image": images})["image"]
    assert [image.shape for image in result] == [(30, 40, 3), (20, 24, 3)]
    np.testing.assert_array_equal(result[1], bc.blur(images[1], 2.0))


def test_a_worker_has_one_renderer_for_a_size_and_settings():
    steps.renderer.cache_clear()
    step = steps.Blur(2.0, aperture=bc.heart())
    for _ in range(3):
        # As a worker receives it, pickled with each task.
        pickle.loads(pickle.dumps(step))({"image": pictures(2)})
    assert steps.renderer.cache_info().misses == 1 and steps.renderer.cache_info().hits == 5


def test_what_is_wrong_is_said():
    with pytest.raises(KeyError, match="there is no column 'coc'; there are 'image'"):
        steps.Blur()({"image": pictures(1)})
    with pytest.raises(ValueError, match=r"\(30, 40\), but \(height, width, 3\)"):
        steps.Blur(1.0)({"image": pictures(1)[..., 0]})
    with pytest.raises(TypeError, match="apertur"):
        steps.Blur(1.0, apertur="disc")


@pytest.mark.skipif(not has_ray_data, reason="needs Ray Data: pip install 'bokehcam[ray]'")
def test_in_a_pipeline_of_tasks_and_of_actors(cluster, recordings):
    script = f"""
import json, numpy as np, ray, bokehcam as bc, bokehcam.ray
from ray.data import ActorPoolStrategy
ray.init(address={cluster.address!r}, log_to_driver=False, logging_level="ERROR")
ray.data.DataContext.get_current().enable_progress_bars = False
files = [{str(recordings / "portrait" / "rgb")!r} + f"/{{k:06}}.png" for k in range(4)]
read = lambda: ray.data.read_images(files, include_paths=True)
tasks = read().map_batches(bokehcam.ray.Blur(coc=3.0, quality="draft"), batch_size=2)
actors = read().map_batches(bokehcam.ray.Blur, fn_constructor_kwargs={{"coc": 3.0, "quality": "draft"}}, batch_size=2,
                            compute=ActorPoolStrategy(size=1))
raw = {{row["path"]: row["image"] for row in read().take_all()}}
same = []
for pipeline in (tasks, actors):
    rows = {{row["path"]: row["image"] for row in pipeline.take_all()}}
    same += [np.array_equal(rows[path], bc.blur(image, 3.0, quality="draft")) for path, image in raw.items()]
print(json.dumps(same))
"""
    run = subprocess.run([sys.executable, "-c", script], env=environment(), capture_output=True, text=True, timeout=240)
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout.splitlines()[-1]) == [True] * 8
