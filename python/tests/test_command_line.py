"""Bit-identical pictures to the program's, on the bundled recordings."""

import json

import numpy as np
import pytest

import bokehcam as bc


def read_pfm(path):
    header, rest = path.read_bytes().split(b"\n", 1)
    size, rest = rest.split(b"\n", 1)
    scale, data = rest.split(b"\n", 1)
    assert header == b"Pf"
    width, height = map(int, size.split())
    values = np.frombuffer(data, "<f4" if float(scale) < 0 else ">f4").reshape(height, width)
    return values[::-1].astype(np.float32)


def write_pfm(path, values):
    height, width = values.shape
    path.write_bytes(f"Pf\n{width} {height}\n-1\n".encode() + values[::-1].astype("<f4").tobytes())


def flags(settings):
    return [f"--{name.replace('_', '-')}={value}" for name, value in settings.items()]


@pytest.mark.parametrize("settings", [
    {},
    {"focus": 1.0, "coc_at_infinity": 12, "aperture": "polygon:6:15", "quality": "best"},
    {"highlights": 12, "coc_at_infinity": "4%", "rim": 0.1, "intensity": -0.6, "refine": "on"},
    {"method": "gather", "rank": 3, "f_number": 1.8, "focal_length": 50, "sensor_width": 36, "max_coc": 15},
    {"effect": "tilt-shift", "tilt": "0.6:0.1:10", "aperture": "heart"},
    {"effect": "blur", "coc_at_infinity": 9.5, "aperture": "star:5", "quality": "draft"},
    {"behind": "color:#00b140", "focus": 1.0},
    {"privacy": "on", "coc_at_infinity": 3},
])
def test_render_is_the_command_render(program, recordings, portrait, tmp_path, settings):
    depth = recordings / "portrait" / "depth" / "000000.png"
    color = recordings / "portrait" / "rgb" / "000000.png"
    follows_depth = settings.get("effect", "dof") == "dof"
    given = ["--depth-map", depth] if follows_depth else []
    program("render", color, *given, "--out", tmp_path / "out.png", "--backend", "cpu", *flags(settings))
    ours = bc.render(portrait.color, portrait.depth if follows_depth else None, **settings)
    np.testing.assert_array_equal(ours, bc.read_image(tmp_path / "out.png"))
    assert (ours != portrait.color).any()


def test_one_radius_is_the_effect_blur(program, recordings, portrait, tmp_path):
    color = recordings / "portrait" / "rgb" / "000000.png"
    program("render", color, "--effect=blur", "--coc-at-infinity=7.5", "--backend=cpu", "--aperture=polygon:5",
            "--out", tmp_path / "out.png")
    expected = bc.read_image(tmp_path / "out.png")
    np.testing.assert_array_equal(bc.blur(portrait.color, 7.5, aperture=bc.polygon(5)), expected)
    renderer = bc.Renderer((640, 360), aperture="polygon:5")
    np.testing.assert_array_equal(renderer(portrait.color, 7.5), expected)


@pytest.mark.parametrize("lens", [
    {"at_infinity_px": 12.0},
    {"f_number": 2, "focal_length_mm": 50, "sensor_width_mm": 36, "focus_range_m": 0.2},
])
def test_a_map_of_radii_is_depth_without_outlines(program, recordings, portrait, tmp_path, lens):
    """Without mixed and unknown pixels, the program does the same as `blur`."""
    slope = np.linspace(0.9, 4, 640 * 360, dtype=np.float32).reshape(360, 640)
    write_pfm(tmp_path / "depth.pfm", slope)
    color = recordings / "portrait" / "rgb" / "000000.png"
    names = {"at_infinity_px": "coc_at_infinity", "focal_length_mm": "focal_length", "sensor_width_mm": "sensor_width",
             "focus_range_m": "focus_range"}
    settings = {names.get(name, name): value for name, value in lens.items()}
    program("render", color, "--depth-map", tmp_path / "depth.pfm", "--focus=1.5", "--refine=off", "--backend=cpu",
            "--out", tmp_path / "out.png", *flags(settings))
    coc = bc.coc_from_depth(slope, 1.5, **lens)
    assert coc.min() < -1 and coc.max() > 1
    # The program creates filters for the possible radii behind and in front of the focal plane.
    most_px = np.float32(360) * np.float32(0.06)
    behind_px = lens.get("at_infinity_px") or 2500 / (2 * 2 * (1500 - 50)) * 640 / 36
    ours = bc.blur(portrait.color, coc, max_coc_px=(most_px, min(behind_px, most_px)))
    np.testing.assert_array_equal(ours, bc.read_image(tmp_path / "out.png"))


@pytest.mark.parametrize("settings", [{}, {"max_disparity": 96}, {"effort": "fast"}])
def test_match_is_the_command_depth(program, recordings, tmp_path, settings):
    pictures = [recordings / "stereo" / eye / "000003.png" for eye in ("image_2", "image_3")]
    program("depth", *pictures, "--out", tmp_path / "out.pfm", "--backend=cpu", *flags(settings))
    expected = read_pfm(tmp_path / "out.pfm")
    left = bc.Recording(recordings / "stereo")[3].color
    ours = bc.match(left, bc.read_image(pictures[1]), **settings)
    np.testing.assert_array_equal(np.where(ours > 0, ours, np.inf), expected)
    assert (ours > 0).mean() > 0.5


def test_low_rank_is_the_command_aperture(program, tmp_path):
    program("aperture", "--out", tmp_path / "kernels", "--apertures=heart,polygon:6:15", "--size=33", "--rim=0.2")
    for entry in json.loads((tmp_path / "kernels" / "aperture.json").read_text())["apertures"]:
        opening = bc.aperture(entry["aperture"], rim=0.2)
        for errors in entry["ranks"]:
            ours = opening.low_rank(errors["rank"], 33)
            assert ours.relative_error == pytest.approx(errors["truncation_error"], rel=1e-9, abs=1e-12)
