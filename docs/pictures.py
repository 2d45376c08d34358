"""Pictures of the pages the program makes, into docs/pictures/: `make pictures`. Needs Chromium and Pillow.

Everything is made anew by the program's own commands in a scratch folder; nothing is retouched.
"""

import io
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "docs" / "pictures"
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
COLOURS = 128  # of a picture: flat ink needs no more

PLAN = """
controllers = ["c-mpc", "zd-pd"]
[scenario]
steps = 6
[[grid]]
name = "push and torso mass"
[[grid.axes]]
name = "push in step 2 [N]"
paths = ["pushes.0.force"]
also = ["pushes.0.step = 2"]
values = [10.0, 20.0, 30.0, 40.0, 50.0]
[[grid.axes]]
name = "mass of torso"
paths = ["plant.mass_factor.torso"]
values = [0.8, 1.0, 1.2, 1.5, 2.0]
[[margin]]
name = "how far"
[[margin.axes]]
name = "push in step 1 [N]"
paths = ["pushes.0.force"]
also = ["pushes.0.step = 1"]
nominal = 0.0
low = -40.0
high = 80.0
tolerance = 5.0
typical = 10.0
look = 2
"""


def cmpc(*words: str) -> None:
    """Run the program in this checkout."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-m", "sim", *words], env=environment, capture_output=True, text=True)
    if done.returncode not in (0, 1):
        raise SystemExit(f"cmpc {' '.join(words)}: {done.stderr}")


def photograph(page: Path, name: str, width: int = 1200, height: int = 800) -> None:
    """A picture of a page as a browser shows it."""
    browser = next((found for found in map(shutil.which, BROWSERS) if found), None)
    if browser is None:
        raise SystemExit(f"docs/pictures.py needs a browser: one of {', '.join(BROWSERS)}")
    with tempfile.TemporaryDirectory() as folder:
        shot = Path(folder) / "shot.png"
        words = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--virtual-time-budget=8000"]
        words += [f"--window-size={width},{height}", f"--screenshot={shot}", page.resolve().as_uri()]
        subprocess.run([browser, *words], check=True, capture_output=True, timeout=120)
        keep(shot.read_bytes(), name)


def keep(png: bytes, name: str) -> None:
    """Write a picture with as few bytes as its inks need."""
    from PIL import Image

    OUT.mkdir(exist_ok=True)
    picture = Image.open(io.BytesIO(png)).convert("RGB").quantize(COLOURS)
    picture.save(OUT / f"{name}.png", optimize=True)
    print(f"docs/pictures/{name}.png", (OUT / f"{name}.png").stat().st_size // 1000, "kB", flush=True)


def review() -> None:
    """A run that fell, and beside it the same under C-MPC."""
    cmpc("run", "push-40N-first", "--controller", "zd-pd", "--steps", "8", "--log", "fall.mcap")
    cmpc("run", "push-40N-first", "--steps", "8", "--log", "walk.mcap")
    cmpc("review", "fall.mcap", "--out", "fall.html", "--no-open")
    cmpc("review", "walk.mcap", "fall.mcap", "--out", "both.html", "--no-open")
    photograph(Path("fall.html"), "review")
    photograph(Path("both.html"), "review-two")


def film() -> None:
    """Two runs side by side; needs the extra `video` and OpenGL."""
    for controller in ("c-mpc", "zd-pd"):
        cmpc("run", "push-25N", "--steps", "6", "--controller", controller, "--log", f"{controller}.mcap")
    cmpc("video", "c-mpc.mcap", "zd-pd.mcap", "walk.gif", "--size", "720", "300", "--fps", "15")
    shutil.copy("walk.gif", OUT / "walk.gif")


def card() -> None:
    """What a notebook shows of a log."""
    sys.path.insert(0, str(ROOT))
    import sim

    style = "<style>body{font:14px system-ui;margin:12px}th,td{padding:1px 8px}</style>"
    Path("card.html").write_text(style + sim.read("fall.mcap")._repr_html_(), encoding="utf-8")
    photograph(Path("card.html"), "notebook", 760, 1000)


def trials() -> None:
    """The page of a campaign."""
    Path("plan.toml").write_text(PLAN, encoding="utf-8")
    cmpc("trials", "plan.toml", "--out", "campaign")
    photograph(Path("campaign/report.html"), "trials", 1100, 1000)


def gait() -> None:
    """A gait as `cmpc gait check --plot` draws it."""
    cmpc("gait", "check", "paper-polished", "--plot", "gait.png")
    keep(Path("gait.png").read_bytes(), "gait")


def reproduce() -> None:
    """The page of the paper's figures, one of them, coarse."""
    cmpc("reproduce", "fig3", "--quick", "--out", "reproduce")
    photograph(next(Path("reproduce").glob("*.html")), "reproduce", 1100, 1000)


ALL: tuple[Callable[[], None], ...] = (review, film, card, trials, gait, reproduce)


def main() -> None:
    """Make all pictures, or those named."""
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for make in ALL:
            if not sys.argv[1:] or make.__name__ in sys.argv[1:]:
                make()


if __name__ == "__main__":
    main()
