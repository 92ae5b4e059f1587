"""Depth-aware background blur."""
