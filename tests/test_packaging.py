"""The sdist, the wheel built from it, and the command installed from the wheel, away from the checkout."""

import os
import site
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
DATA = ("models", "problems", "configs")

pytestmark = pytest.mark.skipif(not (ROOT / "pyproject.toml").exists(), reason="the tests do not run in a source tree")


@pytest.fixture(scope="module")
def distributions(tmp_path_factory) -> tuple[Path, Path]:
    """The sdist and the wheel, built as a release is: the wheel from the sdist."""
    folder = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(folder), str(ROOT)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    (sdist,) = folder.glob("*.tar.gz")
    (wheel,) = folder.glob("*.whl")
    return sdist, wheel


@pytest.fixture(scope="module")
def installed(distributions, tmp_path_factory) -> Path:
    """A fresh environment with the wheel; its dependencies are those of the environment the tests run in."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, with_pip=True)
    python = folder / "bin" / "python"
    subprocess.run([python, "-m", "pip", "install", "-q", "--no-deps", str(distributions[1])], check=True)
    (packages,) = folder.glob("lib/python*/site-packages")
    paths = [p for p in site.getsitepackages() if Path(p).is_dir()]
    (packages / "dependencies.pth").write_text("".join(f"import site; site.addsitedir({p!r})\n" for p in paths))
    return folder


def checkout_files(folder: str) -> dict[str, bytes]:
    return {str(p.relative_to(ROOT)): p.read_bytes() for p in sorted((ROOT / folder).rglob("*")) if p.is_file()}


def run(environment: Path, folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    variables = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    program = [str(environment / "bin" / command[0]), *command[1:]]
    return subprocess.run(program, cwd=folder, env=variables, capture_output=True, text=True)


def test_the_wheel_holds_the_package_and_its_data_and_nothing_else(distributions):
    with zipfile.ZipFile(distributions[1]) as wheel:
        names = [n for n in wheel.namelist() if ".dist-info/" not in n]
        for kind in DATA:
            for name, content in checkout_files(kind).items():
                assert wheel.read(f"gmr_traj/share/{name}") == content
    assert all(n.startswith("gmr_traj/") for n in names)
    modules = {n for n in checkout_files("gmr_traj") if "__pycache__" not in n}
    shared = {n for n in names if n.startswith("gmr_traj/share/")}
    assert set(names) - shared == modules


def test_the_sdist_holds_what_builds_and_tests_the_project(distributions):
    with tarfile.open(distributions[0]) as sdist:
        names = {name.split("/", 1)[1] for name in sdist.getnames()}
    for name in ("pyproject.toml", "LICENSE", "README.md", "CHANGELOG.md", "tests/test_packaging.py", ".ci/run"):
        assert name in names
    assert not [n for n in names if "_refined." in n or "__pycache__" in n]


def test_the_command_runs_from_another_folder(installed, tmp_path):
    done = run(installed, tmp_path, "gmr-traj", "--version")
    assert done.returncode == 0, done.stderr
    script = (
        "import gmr_traj; from gmr_traj import resources;"
        "print(gmr_traj.__file__); print(resources.find('models', 'unitree_g1')); print(resources.names('problems'))"
    )
    done = run(installed, tmp_path, "python", "-c", script)
    assert done.returncode == 0, done.stderr
    package, robot, problems = done.stdout.splitlines()
    assert package.startswith(str(installed)) and robot.startswith(str(installed))
    assert "refine" in problems


def test_the_installed_command_refines_the_example(installed, tmp_path):
    example = next(p for p in sorted((ROOT / "examples").glob("*.npz")) if "_refined" not in p.name)
    (tmp_path / example.name).write_bytes(example.read_bytes())
    done = run(installed, tmp_path, "gmr-traj", "refine", example.name)
    assert done.returncode == 0, done.stdout + done.stderr
    written = {p.name for p in tmp_path.iterdir()}
    assert written == {example.name, f"{example.stem}_refined.npz", f"{example.stem}_refined.npz.report.json"}
