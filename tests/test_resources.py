"""Finding models, problems and configs by name or path."""

from __future__ import annotations

from pathlib import Path

import pytest

from gmr_traj import resources
from gmr_traj.exceptions import ResourceError


@pytest.fixture
def installation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package folder in a checkout, with resources beside the package."""
    package = tmp_path / "gmr_traj"
    package.mkdir()
    monkeypatch.setattr(resources, "_PACKAGE", package)
    monkeypatch.chdir(package)
    for name in ("beta", "alpha"):
        (tmp_path / "models" / name).mkdir(parents=True)
        (tmp_path / "models" / name / "robot.toml").touch()
    (tmp_path / "models" / "notes").mkdir()
    (tmp_path / "problems").mkdir()
    (tmp_path / "problems" / "refine.toml").touch()
    return tmp_path


def test_finds_the_g1_that_ships() -> None:
    assert (resources.find("models", "unitree_g1") / "robot.toml").is_file()
    assert "unitree_g1" in resources.names("models")


def test_names_are_folders_with_a_robot_and_toml_files(installation: Path) -> None:
    assert resources.names("models") == ("alpha", "beta")
    assert resources.names("problems") == ("refine",)


def test_finds_by_name_with_and_without_suffix(installation: Path) -> None:
    expected = installation / "problems" / "refine.toml"
    assert resources.find("problems", "refine") == expected
    assert resources.find("problems", "refine.toml") == expected


def test_the_wheel_s_folder_wins_over_the_checkout_s(installation: Path) -> None:
    shared = installation / "gmr_traj" / "share" / "problems"
    shared.mkdir(parents=True)
    (shared / "refine.toml").touch()
    assert resources.find("problems", "refine") == shared / "refine.toml"


def test_an_existing_path_wins_over_a_name(installation: Path, tmp_path: Path) -> None:
    own = Path("refine.toml")
    own.touch()
    assert resources.find("problems", own) == own.resolve()


def test_a_path_is_never_looked_up_as_a_name(installation: Path) -> None:
    with pytest.raises(ResourceError, match="elsewhere/refine"):
        resources.find("problems", "elsewhere/refine")


def test_unknown_name_lists_those_that_exist(installation: Path) -> None:
    with pytest.raises(ResourceError, match=r"there are: alpha, beta$"):
        resources.find("models", "gamma")


def test_unknown_kind_lists_the_kinds() -> None:
    with pytest.raises(ResourceError, match="models, problems, configs"):
        resources.find("robots", "unitree_g1")


def test_installation_without_a_folder_says_so(installation: Path) -> None:
    with pytest.raises(ResourceError, match="carries no configs"):
        resources.find("configs", "any")
