"""Where a log came from: package versions, revision, machine. Imports none of the packages it names."""

import os
import platform
import subprocess
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGES = (
    "cmpc-walker",
    "mujoco",
    "numpy",
    "pin",
    "numba",
    "qpsolvers",
    "clarabel",
    "daqp",
    "piqp",
    "scipy",
    "mcap",
    "protobuf",
)
"""Distributions whose version can change a run or its log."""

_ROOT = Path(__file__).resolve().parents[2]
_GIT_TIMEOUT = 5.0  # [s]


@dataclass(frozen=True, slots=True)
class GitState:
    """State of the checkout.

    Attributes:
        revision: Commit hash; None outside a checkout or before the first commit.
        dirty: Whether tracked files differ from it; None outside a checkout.
    """

    revision: str | None
    dirty: bool | None


def package_versions() -> dict[str, str]:
    """Version of each of `PACKAGES` that is installed."""
    found = {}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def git_state(root: Path = _ROOT) -> GitState:
    """Revision and dirty flag of this project's own checkout, by one call of git.

    Args:
        root: Directory of the project; one without its own `.git` has no revision, even inside another
            project's checkout.
    """
    nothing = GitState(None, None)
    if not (root / ".git").exists():
        return nothing
    command = ["git", "--no-optional-locks", "status", "--porcelain=v2", "--branch", "--untracked-files=no"]
    try:
        done = subprocess.run(command, cwd=root, capture_output=True, text=True, timeout=_GIT_TIMEOUT, check=True)
    except (OSError, subprocess.SubprocessError):
        return nothing
    lines = done.stdout.splitlines()
    heads = [line.split()[-1] for line in lines if line.startswith("# branch.oid ")]
    revision = next((head for head in heads if head != "(initial)"), None)
    return GitState(revision, any(not line.startswith("#") for line in lines))


def machine() -> dict[str, str]:
    """What may change the last bits of a run.

    Returns:
        "cpu", "blas" (its library and the kernel it picked) and "kernels" (digest of the sources of compiled kernels
        and of what compiles them).
    """
    import llvmlite.binding
    from threadpoolctl import threadpool_info

    from controller.common.compiled import ROOT, digest

    target = os.environ.get("NUMBA_CPU_NAME") or llvmlite.binding.get_host_cpu_name()
    libraries = {
        f"{one['internal_api']} {one['version']} {one.get('architecture', '')}".strip()
        for one in threadpool_info()
        if one["user_api"] == "blas"
    }
    sources = (ROOT / "controller" / "laws.py", ROOT / "sim" / "plant" / "rigid_plant.py")
    return {
        "cpu": f"{_processor()}, compiled for {target}",
        "blas": ", ".join(sorted(libraries)),
        "kernels": " ".join(digest(file) for file in sources if file.is_file()),
    }


def _processor() -> str:
    """Name of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def platform_name() -> str:
    """Operating system, machine and Python version on one line."""
    return f"{platform.platform()}, Python {platform.python_version()}"
