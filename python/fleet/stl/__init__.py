"""The specification: mission formulas as text, as trees and in the normal form of the planner."""

from fleet.stl.default import default_formula
from fleet.stl.normal import Event, Gather, Invariant, NormalForm, Rest, Visit, drones_of, normal_form
from fleet.stl.printer import attributes_text, clause_text, to_text
from fleet.stl.text import parse
from fleet.stl.vocabulary import RESERVED, Clause, Formula, Vocabulary, is_name

__all__ = [
    "RESERVED",
    "Clause",
    "Event",
    "Formula",
    "Gather",
    "Invariant",
    "NormalForm",
    "Rest",
    "Visit",
    "Vocabulary",
    "attributes_text",
    "clause_text",
    "default_formula",
    "drones_of",
    "is_name",
    "normal_form",
    "parse",
    "to_text",
]
