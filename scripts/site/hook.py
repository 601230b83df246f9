"""What MkDocs does for our site beyond mkdocs.yml: which files it holds, and how links are read.

The site holds the Markdown files of the repository at their own paths. To these come pages that
are generated: the references, the notebooks, and one for each folder and source file to which a
page links, so that such a link leads to something here as it does on a code host.
"""

from __future__ import annotations

import gc
import os
import posixpath
import re
from pathlib import Path
from typing import Any

import commands
import notebooks
import reference
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

gc.disable()  # a build drops little of what it makes; to look for it took a sixth of the time

ROOT = Path(__file__).resolve().parents[2]
PAGES = ("*.md", "docs/**/*.md", "benchmarks/*.md", "campaign/*.md", "examples/*/*.md")
OTHER_FILES = ("docs/images/*", "docs/site.css", "docs/iframe-worker.js")
LINK = re.compile(r"(?<=\]\()(?![a-z]+:)([^)#\s]+)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Return the files of the site; those that MkDocs found below `docs_dir` are among them."""
    theme = [file for file in files if file.src_dir != config.docs_dir]
    whole = Files(theme)
    for path in _found(PAGES + OTHER_FILES):
        uri = path.relative_to(ROOT).as_posix()
        whole.append(File.generated(config, uri, abs_src_path=str(path)))

    execute = os.environ.get("HYPERMAP_NOTEBOOKS", "run") == "run"
    generated: dict[str, str | bytes] = {"reference/commands.md": commands.page()}
    generated |= reference.pages(ROOT, "reference/python/")
    for path in _found(("notebooks/*.ipynb",)):
        generated |= notebooks.page(path, execute=execute)
    generated |= _linked_pages()
    for uri, content in generated.items():
        whole.append(File.generated(config, uri, content=content))

    config.nav = _with_folders(config.nav, sorted(file.src_uri for file in whole))
    return whole


def on_page_markdown(markdown: str, page: Page, files: Files, **_: Any) -> str:
    """Let links to folders and source files lead to the pages that show them."""
    here = posixpath.dirname(page.file.src_uri)

    def target(match: re.Match[str]) -> str:
        uri = posixpath.normpath(posixpath.join(here, match[1]))
        for shown in (f"{uri}/README.md", f"{uri}.md"):
            if files.get_file_from_path(uri) is None and files.get_file_from_path(shown):
                return posixpath.relpath(shown, here or ".")
        return match[1]

    return LINK.sub(target, markdown)


def _found(patterns: tuple[str, ...]) -> list[Path]:
    return [path for pattern in patterns for path in sorted(ROOT.glob(pattern)) if path.is_file()]


def _linked_pages() -> dict[str, str | bytes]:
    """Return a page for each folder and source file to which the repository's pages link."""
    pages: dict[str, str | bytes] = {}
    for page in _found(PAGES):
        for name in LINK.findall(page.read_text(encoding="utf-8")):
            target = Path(os.path.normpath(page.parent / name))
            if not target.is_relative_to(ROOT):
                continue
            uri = target.relative_to(ROOT).as_posix()
            if target.is_dir() and not (target / "README.md").exists():
                pages[f"{uri}/README.md"] = _page_of_folder(target)
            elif target.suffix in (".py", ".toml", ".yaml", ".sh"):
                pages[f"{uri}.md"] = f"# {target.name}\n\n{_as_code(target)}"
    return pages


def _page_of_folder(folder: Path) -> str:
    """Return a list of a folder's pages; of a folder with scripts, the scripts as well."""
    parts = [f"# {folder.name.capitalize()}"]
    pages = sorted(folder.glob("*.md")) + sorted(folder.glob("*/README.md"))
    parts.append(
        "\n".join(f"- [{_title(page)}]({page.relative_to(folder).as_posix()})" for page in pages)
    )
    scripts = sorted(folder.glob("*.py"))
    parts += [f"## {script.name}\n\n{_as_code(script)}" for script in scripts]
    return "\n\n".join(parts)


def _title(page: Path) -> str:
    return page.read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ")


def _as_code(path: Path) -> str:
    language = {".py": "python", ".sh": "sh"}.get(path.suffix, path.suffix[1:])
    return f"````{language}\n{path.read_text(encoding='utf-8')}````\n"


def _with_folders(nav: Any, uris: list[str]) -> Any:
    """Return the navigation; an entry that ends with a slash is all pages of that folder."""
    if isinstance(nav, dict):
        return {title: _with_folders(entry, uris) for title, entry in nav.items()}
    if isinstance(nav, list):
        return [_with_folders(entry, uris) for entry in nav]
    if not nav.endswith("/"):
        return nav
    return [uri for uri in uris if uri.startswith(nav) and uri.endswith(".md")]
