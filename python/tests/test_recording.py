"""Recordings as sequences of frames."""

import pickle
import shutil

import numpy as np
import pytest

import bokehcam as bc


def test_frames_come_one_after_the_other(recordings):
    recording = bc.Recording(recordings / "portrait")
    assert (recording.layout, recording.size, len(recording)) == ("TUM RGB-D", (640, 360), 24)
    assert recording.has_depth and not recording.has_right and recording.period_ns > 0
    times = []
    for frame in recording:
        assert frame.color.shape == (360, 640, 3) and frame.color.dtype == np.uint8
        assert frame.depth.shape == (360, 640) and frame.depth.dtype == np.float32 and frame.right is None
        assert frame.index == len(times)
        times.append(frame.time_ns)
    assert times[0] == 0 and (np.diff(times) > 0).all() and len(times) == 24
    assert 0.3 < recording[0].depth.min() < recording[0].depth.max() < 13.2
    np.testing.assert_array_equal(recording[-1].color, frame.color)
    assert [frame.index for frame in recording[3:9:2]] == [3, 5, 7]
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(recording))[2].color, recording[2].color)
    for out in (24, -25):
        with pytest.raises(IndexError, match=f"frame {out} of 24"):
            recording[out]


def test_two_eyes_are_read(recordings):
    recording = bc.Recording(recordings / "stereo")
    assert recording.has_right and not recording.has_depth
    frame = recording[0]
    assert frame.depth is None and frame.right.shape == (360, 640) and frame.right.dtype == np.uint8


def test_what_is_wrong_with_a_recording_is_said(recordings, tmp_path):
    with pytest.raises(OSError, match="not a recording"):
        bc.Recording(tmp_path)
    with pytest.raises(ValueError, match="depth scale is 0"):
        bc.Recording(recordings / "portrait", depth_scale=0)
    copy = tmp_path / "copy"
    shutil.copytree(recordings / "portrait", copy)
    (copy / "rgb" / "000002.png").write_bytes(b"no picture")
    recording = bc.Recording(copy)
    assert recording[1].color.shape == (360, 640, 3)
    with pytest.raises(OSError, match="000002.png"):
        recording[2]
    scaled = bc.Recording(copy, depth_scale=2500)
    np.testing.assert_allclose(scaled[0].depth, 2 * recording[0].depth)
