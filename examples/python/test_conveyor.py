"""Publisher, consumer and request server against stand-ins alone: `pytest examples/python/test_conveyor.py`."""

import os
import sys

import pytest
from conveyor import BELT, SPEED, Belt, Counter, SetSpeed
from hero_ril import RequestFailed
from hero_ril.testing import final_report, nothing_lost, until


def running(samples):
    return (Belt(speed_mps=2.0, moved_m=0.04 * step) for step in range(samples))


def test_the_counter_loses_nothing_of_a_script_that_is_longer_than_a_queue(hero_domain):
    counter = Counter(hero_domain.join())
    hero_domain.topic(BELT, Belt).play(running(1000))
    assert counter.wait_for(39.95) == 1000
    nothing_lost(counter.belt)


def test_the_counter_goes_on_after_garbage_silence_and_the_death_of_the_drive(hero_domain):
    counter = Counter(hero_domain.join())
    belt = hero_domain.topic(BELT, Belt)
    belt.play(running(50))
    belt.stall(0.1)
    belt.restart()
    belt.play(running(1000))
    belt.garbage(7, 100)
    counter.wait_for(41.0)


def test_the_drive_moves_the_belt_as_it_is_asked_and_says_so(hero_domain):
    robot = hero_domain.join()
    belt = robot.subscribe(BELT, Belt)
    program = os.path.join(os.path.dirname(__file__), "conveyor.py")
    drive = hero_domain.process(sys.executable, program, stdout=-1)
    assert drive.stdout.readline() == b"ready\n"
    for speed, stage in [(1.5, "done"), (9.0, "refused"), (float("nan"), "refused")]:
        assert final_report(robot.send(SPEED, SetSpeed(speed_mps=speed))).stage == stage
    until(belt, lambda sample: sample.speed_mps == 1.5 and sample.moved_m > 0.1)
    nothing_lost(belt)


def test_a_client_learns_of_a_drive_that_hangs_refuses_or_dies(hero_domain):
    drive = hero_domain.server(SPEED, SetSpeed)
    robot = hero_domain.join()
    drive.answer_next(lambda order: order.refuse("busy"))
    with pytest.raises(RequestFailed, match="busy"):
        robot.send(SPEED, SetSpeed(speed_mps=1.0)).wait()
    assert drive.next_request().speed_mps == 1.0
    drive.answer_next("hang")
    assert robot.send(SPEED, SetSpeed(speed_mps=2.0)).next(0.05) is None
    drive.answer_next("die")
    assert final_report(robot.send(SPEED, SetSpeed(speed_mps=3.0))).stage == "unknown"
