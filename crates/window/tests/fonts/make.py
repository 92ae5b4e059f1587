#!/usr/bin/env python3
"""Makes signs.ttf, a font of three signs for tests: a Cyrillic, a Greek and a Chinese one, each a plain box.

Needs fonttools (pip install fonttools).
"""
from fontTools.fontBuilder import FontBuilder
from fontTools.pens.ttGlyphPen import TTGlyphPen

SIGNS = "ДΩ中"


def box(width: int):
    pen = TTGlyphPen(None)
    pen.moveTo((100, 0))
    for corner in [(100, 700), (width - 100, 700), (width - 100, 0)]:
        pen.lineTo(corner)
    pen.closePath()
    return pen.glyph()


names = [".notdef"] + [f"sign{k}" for k in range(len(SIGNS))]
font = FontBuilder(1000, isTTF=True)
font.setupGlyphOrder(names)
font.setupCharacterMap({ord(sign): name for sign, name in zip(SIGNS, names[1:])})
font.setupGlyf({name: box(600 + 100 * k) for k, name in enumerate(names)})
font.setupHorizontalMetrics({name: (600 + 100 * k, 100) for k, name in enumerate(names)})
font.setupHorizontalHeader(ascent=800, descent=-200)
font.setupNameTable({"familyName": "Bokehcam Test Signs", "styleName": "Regular"})
font.setupOS2(sTypoAscender=800, sTypoDescender=-200, usWinAscent=800, usWinDescent=200)
font.setupPost()
font.save("signs.ttf")
