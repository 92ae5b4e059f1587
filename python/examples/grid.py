#!/usr/bin/env python3
"""A grid of one picture: an aperture in each row, a look in each column.

    python python/examples/grid.py recordings/portrait --out grid.png

The recording has the picture and its depth. `--frame N` takes another of its frames, `--focus METRES` another focus.
"""

import argparse

import numpy as np

import bokehcam as bc

APERTURES = ["disc", "polygon:5", "heart", "star:5"]
LOOKS = {
    "plain": {},
    "soap bubbles": {"intensity": -0.8, "rim": 0.1},
    "dreamy": {"intensity": 0.9, "rim": 0.6},
    "night": {"highlights": 12, "rim": 0.1},
}
GAP = 6


def smaller(image, width):
    """The picture at about `width` columns: means of whole blocks, in linear light."""
    step = max(1, image.shape[1] // width)
    rows, columns = (side // step * step for side in image.shape[:2])
    light = bc.to_linear(image[:rows, :columns])
    return bc.to_srgb(light.reshape(rows // step, step, columns // step, step, 3).mean((1, 3)))


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", help="a folder with pictures and depth")
    parser.add_argument("--out", required=True, help="the grid, .png or .jpg")
    parser.add_argument("--frame", type=int, default=0, help="which frame [default: 0]")
    parser.add_argument("--focus", default="auto", help="metres, auto or X,Y [default: auto]")
    parser.add_argument("--width", type=int, default=320, help="columns of each picture [default: 320]")
    parser.add_argument("--overwrite", action="store_true", help="replace the grid that is there")
    options = parser.parse_args(arguments)

    frame = bc.Recording(options.recording)[options.frame]
    strength = frame.color.shape[0] / 25
    rows = []
    for aperture in APERTURES:
        row = []
        for look in LOOKS.values():
            blurred = bc.render(
                frame.color, frame.depth, focus=options.focus, coc_at_infinity=strength, aperture=aperture, **look
            )
            row.append(np.pad(smaller(blurred, options.width), ((0, GAP), (0, GAP), (0, 0)), constant_values=255))
        rows.append(np.concatenate(row, axis=1))
    bc.write_image(options.out, np.concatenate(rows), overwrite=options.overwrite)
    print(f"{options.out}: rows {', '.join(APERTURES)}; columns {', '.join(LOOKS)}")


if __name__ == "__main__":
    main()
