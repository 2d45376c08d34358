"""Hooks of the site: a page made from the settings, and links that leave docs/.

Such a link becomes the path of a file of the repository, which must be there.
"""

import re
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
OUT = re.compile(r"(!?)\[([^\]]*)\]\((\.\./[^)#\s]+)(?:#[^)]*)?\)")


def on_config(config: Any) -> Any:
    """Put pages that the navigation of mkdocs.yml does not name at its end."""
    named = re.findall(r"[\w-]+\.md", str(config.nav))
    rest = sorted({path.name for path in (ROOT / "docs").glob("*.md")} - set(named))
    if rest:
        config.nav.append({"More": rest})
    return config


def on_files(files: Any, config: Any) -> Any:
    """Add settings.md."""
    from mkdocs.structure.files import File

    sys.path[:0] = [str(ROOT), str(ROOT / "docs")]
    import reference

    files.append(File.generated(config, "settings.md", content=reference.page()))
    return files


def on_page_markdown(markdown: str, page: Any, **rest: Any) -> str:
    """Replace the links of one page.

    Raises:
        FileNotFoundError: a link names no file.
    """
    folder = (ROOT / "docs" / page.file.src_uri).parent

    def path(found: re.Match[str]) -> str:
        target = (folder / found[3]).resolve()
        if not target.exists():
            raise FileNotFoundError(f"{page.file.src_uri}: {found[3]} is not there")
        name = target.relative_to(ROOT).as_posix()
        words = found[2].replace("\\", "")
        return f"`{name}`" if words.strip("`") in (name, target.name) else f"{words} (`{name}`)"

    return OUT.sub(path, markdown)
