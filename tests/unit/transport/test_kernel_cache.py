"""The cache on disk notices an edit in any file of the package, as numba's own does not."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from imclab.transport import kernel_cache

HELPER = "from imclab.transport.kernel_cache import device\n\n\n@device\ndef value():\n    return {}\n"
ENTRY = """from imclab.transport.kernel_cache import cached_kernel
from imclab.transport.edited_helper import value


@cached_kernel
def entry():
    return value()
"""
ASK = (
    "from imclab.transport.edited_entry import entry; print(entry());"
    "print(sum(entry.stats.cache_hits.values()))"
)


def ask(folder: Path) -> list[int]:
    environment = os.environ | {"PYTHONPATH": str(folder), "NUMBA_CACHE_DIR": str(folder / "cache")}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    done = subprocess.run(
        [sys.executable, "-c", ASK], cwd=folder, env=environment, capture_output=True, text=True, check=True
    )
    return [int(line) for line in done.stdout.split()]


def test_an_edited_helper_in_another_file_is_compiled_anew(tmp_path: Path) -> None:
    package = tmp_path / "imclab"
    (package / "transport").mkdir(parents=True)
    (package / "__init__.py").write_text("")
    (package / "transport" / "__init__.py").write_text("")
    shutil.copy(kernel_cache.__file__, package / "transport" / "kernel_cache.py")
    (package / "transport" / "edited_entry.py").write_text(ENTRY)
    helper = package / "transport" / "edited_helper.py"
    helper.write_text(HELPER.format(1))
    assert ask(tmp_path) == [1, 0]
    assert ask(tmp_path) == [1, 1]  # the second process takes it from the disk
    helper.write_text(HELPER.format(2))
    assert ask(tmp_path) == [2, 0]


def test_the_digest_is_of_every_source() -> None:
    assert len(kernel_cache.source_digest()) == 16
    assert (kernel_cache.PACKAGE / "scene.py").is_file()
