"""Module and name of each cam family's record, which is imported when it is first used.

A command that ends in help or in an input error therefore loads no family.
"""

FAMILIES = {
    "polydyne": "camopt.cam.families.polydyne:FAMILY",
    "multi-pol": "camopt.cam.families.multi_pol:FAMILY",
    "new-design": "camopt.cam.families.new_design:FAMILY",
    "exponent": "camopt.cam.families.exponent:FAMILY",
    "kurz": "camopt.cam.families.kurz:FAMILY",
    "trapezoid": "camopt.cam.families.trapezoid:FAMILY",
    "cycloidal": "camopt.cam.families.dwell:CYCLOIDAL",
    "3-4-5": "camopt.cam.families.dwell:POLYNOMIAL_345",
    "4-5-6-7": "camopt.cam.families.dwell:POLYNOMIAL_4567",
}
"""Families whose members are designed from a scene: name on the command line -> module and name of the record."""
BY_COEFFICIENTS = {"free": "camopt.cam.families.free:FAMILY"}
"""Families whose members are defined by their coefficients, so that no command names one."""
