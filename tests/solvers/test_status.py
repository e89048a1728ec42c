"""Status: a name to read, a number to compute with, a sentence for each."""

from solvers.status import MESSAGES, Status


def test_a_status_prints_its_name_and_stays_a_number() -> None:
    assert str(Status.NO_PROGRESS) == f"{Status.NO_PROGRESS}" == "NO_PROGRESS"
    assert Status.NO_PROGRESS == 2 and int(Status(2)) == 2 and not Status.SOLVED


def test_every_status_has_a_sentence() -> None:
    assert set(MESSAGES) == set(Status)
    assert all(text.endswith(".") for text in MESSAGES.values())
