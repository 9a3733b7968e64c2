"""The first look at a log: its columns, its data, the model's fit, the verdict, on one page.

It reads, judges and draws nothing by itself: the import, the guess of columns, validation and
diagnosis do, each in its own package.
"""

from elevon.doctor.answer import DataCheck, Examination, ReadColumn

__all__ = ["DataCheck", "Examination", "ReadColumn"]
