"""A farm without a cluster: errors before the start, and results that appear exactly once and complete."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import pytest
from farm_fixtures import PORTRAIT, PROGRAM, alone, farm, needs_program, needs_ray, recording

pytestmark = needs_program


@pytest.fixture
def take(tmp_path) -> Path:
    return recording(tmp_path / "take", 0)


@pytest.fixture
def job(tmp_path):
    from bokehcam.farm import plan, work

    folder = tmp_path / "out"
    program = str(PROGRAM)
    flags = ("--frames", "2", "--effect", "blur")
    job = work.Job(plan.new_id(), folder, "stream", "y4m", flags, {}, "", program, work.version_of(program), tmp_path)
    with plan.at_work(job):
        yield job


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--out", "out"], "there are no sources"),
        (["take"], "required: --out"),
        (["nowhere", "--out", "out"], "nowhere: there is no such file or folder"),
        (["take", "--out", "out", "--format", "gif"], "--format gif: stream writes mp4, mkv, webm, y4m, png"),
        (["take", "--out", "out", "--cpus", "0"], "--cpus: 0: at least 1"),
        (["take", "--out", "out", "--cpus", "two"], "argument --cpus: invalid number value: 'two'"),
        (["take", "--out", "out", "--", "depth"], "depth: after -- come `stream` or `render`"),
        (["take", "--out", "out", "--", "--bogus"], "there is no option --bogus of `stream`"),
        (["take", "--out", "out", "--", "--rim", "thick"], "invalid value 'thick' for '--rim"),
        (["take", "--out", "out", "--", "stream", "take2"], "unexpected argument 'take2'"),
        (["take", "--out", "out", "--", "--to=b.mp4"], "--to: the farm sets this itself"),
        (["take", "--out", "out", "--", "--loop"], "--loop: it would never end; add --frames N"),
        (["take", "--out", "out", "--depth-maps", "."], "--depth-maps is for `render`"),
        (["take", "--out", "out", "--", "render"], "take: it contains no pictures"),
        (["--list", "nowhere", "--out", "out"], "--list nowhere: "),
    ],
)
def test_wrong_arguments_are_one_line_and_nothing_starts(take, tmp_path, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    line = farm(*arguments, expect=2)
    assert said in line and line.startswith("error: ") and line.count("\n") == 1, line
    assert not (tmp_path / "out").exists()


def test_two_sources_with_results_of_one_name_are_refused(tmp_path):
    one, other = recording(tmp_path / "a" / "take", 0), recording(tmp_path / "b" / "take", 1)
    said = farm(one, other, "--out", tmp_path / "out", expect=2)
    assert f"{one} and {other}: the result of both would be take.mp4" in said
    assert not (tmp_path / "out").exists()


def test_a_missing_program_is_no_usage_error(take, tmp_path):
    assert "there is no program nowhere/bokehcam" in farm(
        take, "--out", tmp_path / "out", "--bokehcam", "nowhere/bokehcam", expect=1
    )
    assert "is not bokehcam" in farm(take, "--out", tmp_path / "out", "--bokehcam", "/bin/true", expect=1)


def test_a_result_appears_with_its_report_and_once(job, take):
    from bokehcam.farm import work

    unit = work.Unit(str(take), "take.y4m")
    first = work.make(job, unit, job.program)
    assert (first.cause, first.frames) == ("", 2)
    output = job.folder / "take.y4m"
    assert output.read_bytes() == alone(take, job.folder / "alone.y4m", list(job.flags))
    report = work.finished(job, unit)
    assert report["frames"]["delivered"] == 2 and report["farm"]["source"] == str(take)
    state = output.stat()
    again = work.make(job, unit, "/bin/false")
    assert (again.cause, again.frames) == ("", 2), "what is there is not made again"
    assert output.stat().st_mtime_ns == state.st_mtime_ns and state.st_nlink == 1
    assert not list(job.hidden.glob("*-*"))


def test_a_folder_of_pictures_appears_whole(job, take):
    from dataclasses import replace

    from bokehcam.farm import plan, work

    pictures, unit = replace(job, format="png"), plan.units("stream", [str(take)], "png", None)[0]
    assert work.make(pictures, unit, job.program).frames == 2
    assert sorted(os.listdir(job.folder / "take")) == [".bokehcam", "000000.png", "000001.png"]
    assert plan.to_do(pictures, [unit]) == []
    (job.folder / "take" / "000001.png").unlink()
    with pytest.raises(plan.UsageError, match="has changed since"):
        plan.to_do(pictures, [unit])


def test_of_two_attempts_one_gives_the_result(tmp_path):
    from bokehcam.farm import work

    for make, name in ((lambda path: path.write_text("x"), "file"), (lambda path: path.mkdir(), "folder")):
        final, parts = tmp_path / name, [tmp_path / f"{name}{k}" for k in range(2)]
        for k, part in enumerate(parts):
            make(part)
            if part.is_dir():
                (part / f"{k}.png").touch()
        assert [work.publish(part, final) for part in parts] == [True, False]
        assert final.is_file() or os.listdir(final) == ["0.png"]


def test_results_without_their_whole_report_are_not_finished(job, take):
    from bokehcam.farm import plan, work

    unit = work.Unit(str(take), "take.y4m")
    work.make(job, unit, job.program)
    report, output = work.report_of(job.folder, unit), job.folder / unit.output
    whole = report.read_bytes()
    assert plan.to_do(job, [unit]) == []
    for bytes_of_report, what in (
        (whole[: len(whole) // 2], "is not a report of a farm"),
        (whole.replace(b'"delivered": 2', b'"delivered": 1'), "has changed since"),
        (whole.replace(b'"blur"', b'"none"'), "was made by `stream --frames 2 --effect none`"),
        (whole.replace(b'/take"', b'/other"'), "was made of "),
    ):
        assert bytes_of_report != whole
        report.write_bytes(bytes_of_report)
        with pytest.raises(plan.UsageError, match=what):
            plan.to_do(job, [unit])
        assert report.read_bytes() == bytes_of_report, "nothing is touched"
    report.write_bytes(whole)
    with open(output, "ab") as file:
        file.write(b"more")
    with pytest.raises(plan.UsageError, match="has changed since"):
        plan.to_do(job, [unit])
    # A report without a result belongs to an attempt that stopped in between.
    output.unlink()
    assert plan.to_do(job, [unit]) == [unit]
    assert work.make(job, unit, job.program).cause == ""


def test_foreign_files_stay(job, take):
    from bokehcam.farm import plan, work

    unit, output = work.Unit(str(take), "take.y4m"), job.folder / "take.y4m"
    output.write_text("mine")
    with pytest.raises(plan.UsageError, match="without a report of a farm"):
        plan.to_do(job, [unit])
    # It may also appear while the program runs.
    assert "has appeared meanwhile" in work.make(job, unit, job.program).cause
    assert output.read_text() == "mine" and not list((job.folder / "reports").iterdir())


def test_only_our_own_older_parts_are_swept(job):
    from bokehcam.farm import plan

    names = {
        "0" * 16 + "-0123456789ab": False,
        job.id + "-0123456789ab": True,
        "f" * 16 + "-0123456789ab": True,
        "notes-1": True,
    }
    for name in names:
        (job.hidden / name).mkdir()
        (job.hidden / name / "part").touch()
    (job.hidden / ("0" * 16 + ".toml")).touch()
    plan.sweep(job.hidden, lambda of: of < job.id)
    assert {name: (job.hidden / name).exists() for name in names} == names
    assert not (job.hidden / ("0" * 16 + ".toml")).exists()


def test_one_farm_at_a_time(job):
    from dataclasses import replace

    from bokehcam.farm import plan

    with pytest.raises(plan.FarmError, match="another farm is at work"):
        with plan.at_work(replace(job, id=plan.new_id())):
            pass
    assert job.settings_file.exists()


def test_a_node_that_is_unfit_says_why(job, take, tmp_path):
    from dataclasses import replace

    from bokehcam.farm import work

    unit = [work.Unit(str(take), "take.y4m")]
    for change, why in (
        ({"folder": tmp_path}, "is the shared storage mounted?"),
        ({"program": "nowhere/bokehcam"}, "there is no program nowhere/bokehcam"),
        ({"version": "bokehcam 99"}, "where the job was started with bokehcam 99"),
    ):
        outcome = work.perform(replace(job, **change), unit, node="here")
        assert why in outcome.unfit and not outcome.results
    assert work.perform(job, unit, node="here").results[0].frames == 2


def test_settings_of_the_start_hold_and_those_of_the_node_do_not(job, take, monkeypatch):
    from dataclasses import replace

    from bokehcam.farm import work

    unit = work.Unit(str(take), "take.y4m")
    monkeypatch.setenv("BOKEHCAM_FRAMES", "7")
    monkeypatch.setenv("RUST_LOG", "trace")
    job.settings_file.write_text("frames = 3\n")
    assert work.make(replace(job, flags=("--effect", "none")), unit, job.program).frames == 3
    unit = work.Unit(str(take), "other.y4m")
    assert (
        work.make(replace(job, flags=("--effect", "none"), environment={"BOKEHCAM_FRAMES": "4"}), unit, job.program).frames == 4
    )


def test_threads_change_no_byte(take, tmp_path):
    flags = ["--quality", "draft"]
    assert alone(take, tmp_path / "1.y4m", flags, threads=1) == alone(take, tmp_path / "3.y4m", flags, threads=3)


@needs_ray
def test_pictures_in_shards_with_their_depth_maps(tmp_path):
    """Runs on its own cluster, which it starts and ends."""
    pictures, depths, out = tmp_path / "pictures", tmp_path / "depths", tmp_path / "out"
    for folder in (pictures, depths):
        folder.mkdir()
    for k in range(5):
        shutil.copy(PORTRAIT / "rgb" / f"{k:06}.png", pictures / f"p{k}.png")
        shutil.copy(PORTRAIT / "depth" / f"{k:06}.png", depths / f"p{k}.png")
    # A mask is no picture.
    shutil.copy(PORTRAIT / "depth" / "000000.png", pictures / "p0-mask.png")
    command = [pictures, "--out", out, "--depth-maps", depths, "--shard", "2", "--address", "local"]
    flags = ["--", "render", "--quality", "draft", "--focus", "0.5,0.5"]
    (depths / "p4.png").rename(tmp_path / "p4.png")
    assert "its depth map p4.png or .pfm is not in" in farm(*command, *flags, expect=2)
    (tmp_path / "p4.png").rename(depths / "p4.png")
    (pictures / "p3.png").write_bytes(b"no picture")
    said = farm(*command, *flags, expect=1)
    assert "4 of 5 pictures" in said and f"failed for good:\n  {pictures / 'p3.png'}: " in said, said
    shutil.copy(PORTRAIT / "rgb" / "000003.png", pictures / "p3.png")
    said = farm(*command, *flags)
    assert "5 of 5 pictures" in said and "1 made now" in said and "4 before" in said, said
    assert sorted(path.name for path in out.glob("*.png")) == [f"p{k}.png" for k in range(5)]
    import subprocess

    subprocess.run(
        [
            PROGRAM,
            "-q",
            "render",
            pictures / "p3.png",
            "--depth-map",
            depths / "p3.png",
            "--out",
            tmp_path / "alone.png",
            *flags[2:],
        ],
        check=True,
    )
    assert (out / "p3.png").read_bytes() == (tmp_path / "alone.png").read_bytes()
    assert json.loads((out / "reports" / "p3.png.json").read_text())["farm"]["arguments"][-1] == str(depths / "p3.png")


@needs_ray
def test_flags_that_the_program_refuses_for_all_end_the_farm(cluster, tmp_path):
    """Only the program can reject this: a lens without its focal length."""
    takes = [recording(tmp_path / f"take{k}", k) for k in range(4)]
    said = farm(*takes, "--out", tmp_path / "out", "--address", cluster.address, "--", "--f-number", "1.8", expect=2)
    assert "error: the program refused the first " in said and "focal" in said, said
