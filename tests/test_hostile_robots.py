"""Files of robots that are mutated at random: an error that names the call, the file and the reason, or a robot."""

import warnings

import numpy as np
import pytest

import dojo_opt as dojo
from support.robot_texts import MJCF, URDF, mutated


def refusal(load, path, text):
    """The message of the refusal, empty where a robot was read."""
    path.write_text(text, encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of unexpected motions
        try:
            load(path)
        except ValueError as error:
            return str(error)
    return ""


@pytest.mark.parametrize("seed", range(4))
def test_a_mutated_urdf_is_read_or_refused_by_name(seed, tmp_path):
    path, refused = tmp_path / "robot.urdf", 0
    for k in range(50):
        text = mutated(URDF, np.random.default_rng((seed, k)))
        options = {"repair": bool(k % 2), "collisions": "self" if k % 3 == 0 else None}
        message = refusal(lambda file, options=options: dojo.load_urdf(file, **options), path, text)
        refused += bool(message)
        assert not message or message.startswith("load_urdf: robot.urdf"), message
    assert 10 < refused < 45


def test_a_mutated_mjcf_is_read_or_refused_by_name(tmp_path):
    pytest.importorskip("mujoco")
    path, refused = tmp_path / "robot.xml", 0
    for k in (*range(100), 122, 258, 920, 1004):
        message = refusal(dojo.load_mjcf, path, mutated(MJCF, np.random.default_rng([k, 9])))
        refused += bool(message)
        assert not message or message.startswith("load_mjcf"), message
    assert 20 < refused < 90


def test_entities_do_not_fill_the_memory(tmp_path):
    bombs = "".join(f'<!ENTITY e{k} "{f"&e{k - 1};" * 10}">' for k in range(1, 12))
    text = f'<!DOCTYPE robot [<!ENTITY e0 "0000000000">{bombs}]><robot name="&e11;"><link name="a"/></robot>'
    path = tmp_path / "robot.urdf"
    assert refusal(dojo.load_urdf, path, text).startswith("load_urdf: robot.urdf")
    secret = tmp_path / "secret"
    secret.write_text("secret")
    text = f'<!DOCTYPE robot [<!ENTITY x SYSTEM "{secret.as_uri()}">]><robot name="r"><link name="a">&x;</link></robot>'
    assert "secret" not in refusal(dojo.load_urdf, path, text).replace(str(secret), "")
