"""``python -m studies.site``: build the site into build/docs/site; exit code 1 if anything in it is wrong."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from .check import findings
from .pages import ROOT, copy_pages, write_settings

INTO = ROOT / "build" / "docs"


def main() -> int:
    shutil.rmtree(INTO, ignore_errors=True)
    INTO.mkdir(parents=True)
    copy_pages(INTO / "pages")
    write_settings(INTO)
    builder = Path(sys.executable).with_name("zensical")
    done = subprocess.run([builder, "build", "--strict", "--config-file", INTO / "mkdocs.yml"], cwd=ROOT)
    if done.returncode:
        return done.returncode
    found = findings(INTO / "site")
    print("\n".join(found), file=sys.stderr, end="\n" if found else "")
    sizes = [page.stat().st_size for page in (INTO / "site").rglob("*.html")]
    print(f"{INTO / 'site'}: {len(sizes)} pages, the text of the largest {max(sizes) / 1000:.0f} KB")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
