"""Contact: sliding, sticking, impact and rest against analytic answers."""

from dojo_opt.report.contact.study import Contact

__all__ = ["Contact"]
