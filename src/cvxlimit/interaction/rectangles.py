"""stub"""
from __future__ import annotations
from dataclasses import dataclass
import numpy as np
from numpy.typing import NDArray
from cvxlimit.contacts import Contacts
FloatArray = NDArray[np.float64]

@dataclass(frozen=True, eq=False)
class Rectangles:
    contacts: Contacts
    arm_share: FloatArray
    @classmethod
    def of(cls, contacts: Contacts, moments: str) -> Rectangles:
        return cls(contacts, np.ones(len(contacts)))
    def scaled(self, f: float) -> Rectangles:
        return Rectangles(self.contacts.scaled(f), self.arm_share)
    def inward(self, forces: FloatArray) -> FloatArray:
        return forces
    def outward(self, forces: FloatArray) -> FloatArray:
        return forces
