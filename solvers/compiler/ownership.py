"""Ownership of compiled code: loading code means running it, so only the user and root may have written it."""

from __future__ import annotations

import os
import stat
from pathlib import Path

__all__ = ["OTHERS", "WORLD", "foreign", "is_private_group"]

WORLD = stat.S_IWOTH
OTHERS = stat.S_IWGRP | stat.S_IWOTH


def foreign(path: Path, about: os.stat_result, forbidden: int = OTHERS) -> str:
    """Why the code in a file or folder may be somebody else's; empty when it is the user's own, or root's."""
    if not hasattr(os, "geteuid"):  # Windows, where a user's folders are his own
        return ""
    if about.st_uid not in (os.geteuid(), 0):
        return f"{path} belongs to the user with id {about.st_uid}"
    if about.st_mode & forbidden:
        return f"others can write to {path} (chmod go-w ends that)"
    return ""


def is_private_group(about: os.stat_result) -> bool:
    """Whether the group of a file is that of its owner alone, as many systems give one to each user.

    Such systems make the files of an installation writable for the group.
    """
    try:
        import grp
        import pwd

        owner, group = pwd.getpwuid(about.st_uid).pw_name, grp.getgrgid(about.st_gid)
    except (ImportError, KeyError):
        return False
    return group.gr_name == owner and set(group.gr_mem) <= {owner}
