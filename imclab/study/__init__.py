"""Studies: the results of the paper made again, each from one file, with its statements checked.

>>> study = load_study("data/studies/fig8_energy.toml")
>>> conclusion = run_study(study, "folder")
>>> [statement.true for statement in conclusion.statements]
"""

from imclab.study.conclusion import Conclusion, Statement
from imclab.study.file import Study, load_study
from imclab.study.run import run_study

__all__ = ["Conclusion", "Statement", "Study", "load_study", "run_study"]
