"""Many recordings, or many still pictures, by the program `bokehcam` on many machines, with Ray.

``python -m bokehcam.farm SOURCE... --out DIR -- FLAGS``; see `docs/farm.md`. Needs ``pip install
'bokehcam[ray]'`` where it is started, Ray and the program on each node, and one folder that all nodes see.
"""
