"""The installed package and its documentation."""

import ast
import inspect
import os
import re
from pathlib import Path

import bokehcam as bc
from bokehcam import _core


def workspace_version(repository):
    manifest = (repository / "Cargo.toml").read_text()
    return re.search(r'^version = "(.*)"', manifest, re.M).group(1)


def test_it_has_the_version_of_the_program(repository):
    assert bc.__version__ == workspace_version(repository)


def test_a_wheel_brings_the_licences_of_what_is_built_in():
    text = (Path(bc.__file__).parent / "licences.txt").read_text()
    for crate in ["pyo3", "numpy", "image", "pulp"]:
        assert re.search(rf"^{crate} \d", text, re.M), crate
    assert "Permission is hereby granted" in text


def test_what_is_public_is_explained():
    for name in bc.__all__:
        value = getattr(bc, name)
        if inspect.isclass(value) or inspect.isfunction(value):
            assert len(inspect.getdoc(value) or "") > 15, name
            assert value.__module__.startswith("bokehcam"), name


def test_the_stubs_are_those_of_the_native_half():
    package = Path(bc.__file__).parent
    assert (package / "py.typed").exists()
    tree = ast.parse((package / "_core.pyi").read_text())
    stubs = {node.name: node for node in tree.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    native = {name for name in dir(_core) if not name.startswith("_")}
    assert set(stubs) == native
    for name, stub in stubs.items():
        if isinstance(stub, ast.ClassDef):
            methods = {node.name: node for node in stub.body if isinstance(node, ast.FunctionDef)}
            of_native = {method for method in vars(getattr(_core, name)) if not method.startswith("_")}
            assert set(methods) - {"__init__"} == of_native, name
            signatures = {method: getattr(getattr(_core, name), method) for method in of_native}
            signatures["__init__"] = getattr(_core, name)
        else:
            methods, signatures = {name: stub}, {name: getattr(_core, name)}
        for method, function in signatures.items():
            names = [argument.arg for argument in methods[method].args.args if argument.arg != "self"]
            found = [parameter for parameter in inspect.signature(function).parameters if parameter != "self"]
            assert names == found, f"{name}.{method}"


def test_the_examples_of_the_documentation_run(repository, tmp_path, monkeypatch):
    """Runs the page's Python blocks in order, in a folder with the recordings."""
    page = "docs/python.md"
    monkeypatch.chdir(tmp_path)
    os.symlink(repository / "recordings", tmp_path / "recordings")
    blocks = re.findall(r"^```python\n(.*?)^```", (repository / page).read_text(), re.M | re.S)
    assert blocks
    names = {}
    for block in blocks:
        exec(compile(block, page, "exec"), names)


def test_the_example_draws_its_grid(repository, tmp_path, monkeypatch):
    example = repository / "python" / "examples" / "grid.py"
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "example"}
    exec(compile(example.read_text(), str(example), "exec"), names)
    names["main"]([str(repository / "recordings" / "portrait"), "--out", "grid.png", "--width", "160"])
    assert (tmp_path / "grid.png").read_bytes().startswith(b"\x89PNG")
