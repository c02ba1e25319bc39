"""The report's folder, and the ledger of what each file in it was made from."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path

from imclab import provenance
from imclab.errors import Fault, InputError, OutputError
from imclab.files import check_folder, written_whole

LEDGER = "inputs.json"


class Store:
    """A folder of finished files that a later run with the same inputs need not make again.

    Parameters
    ----------
    folder : Path
    title : str
        Title of the experiment: the report of another one in the same folder is not written over.

    Raises
    ------
    InputError
        When the folder is a file, or holds the report of another experiment or other files.
    OutputError
        When it cannot be made.
    """

    def __init__(self, folder: Path, title: str) -> None:
        self.folder, self._title = folder, title
        self._ledger_path = folder / LEDGER
        if folder.exists() and not folder.is_dir():
            raise InputError(str(folder), [Fault("output", "a file", "a folder")])
        check_folder(folder)
        strangers = folder.is_dir() and any(folder.iterdir()) and not self._ledger_path.is_file()
        if strangers:
            wanted = "a folder that is empty, not there yet, or holds an earlier report"
            raise InputError(str(folder), [Fault("output", "a folder with other files in it", wanted)])
        self._used: set[str] = set()
        self._ledger: dict[str, str] = {}
        if self._ledger_path.is_file():
            kept = json.loads(self._ledger_path.read_text(encoding="utf-8"))
            self._ledger = kept["files"]
            if kept["experiment"] != title:
                advice = "Name another folder, or remove this one first."
                came, wanted = (
                    f'the report of "{kept["experiment"]}"',
                    f'a folder for the report of "{title}"',
                )
                raise InputError(str(folder), [Fault("output", came, wanted, advice)])

    def holds(self, name: str, key: str) -> bool:
        """Tell whether the file ``name`` is there and was made from the inputs that ``key`` names."""
        found = self._ledger.get(name) == key and (self.folder / name).is_file()
        if found:
            self._used.add(name)
        return found

    def keep(self, name: str, key: str, save: Callable[[Path], None]) -> None:
        """Save the file ``name`` and note what it was made from; the folder is made when it is needed."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"{self.folder}: cannot be made ({error.strerror or error})") from error
        self._ledger.pop(name, None)
        self._write()
        save(self.folder / name)
        self._ledger[name] = key
        self._used.add(name)
        self._write()

    def forget_unused(self) -> None:
        """Remove the kept files that this run had no use for: of conditions that are no more."""
        for name in set(self._ledger) - self._used:
            (self.folder / name).unlink(missing_ok=True)
            del self._ledger[name]
        self._write()

    def _write(self) -> None:
        with written_whole(self._ledger_path) as temporary:
            kept = {"experiment": self._title, "files": self._ledger}
            temporary.write_text(json.dumps(kept, indent=2, sort_keys=True) + "\n", encoding="utf-8")


def digest_of(*parts: str) -> str:
    """Return one digest of all inputs of a file, the version of imclab among them."""
    return hashlib.sha256("\0".join([provenance.versions()["imclab"], *parts]).encode()).hexdigest()
