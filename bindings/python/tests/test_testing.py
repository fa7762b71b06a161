"""The stand-ins for the robot's own processes that the plugin of pytest brings: `pytest bindings/python/tests/test_testing.py`."""

import pytest
from hero_ril import RequestFailed, structs
from hero_ril.testing import final_report, nothing_lost, until


def test_status_plays_a_script_that_is_longer_than_a_queue(hero_domain, hero_status):
    telemetry = hero_domain.join().telemetry()
    hero_status.play(structs.HeroTelemetry(flying=step >= 900) for step in range(1000))
    assert until(telemetry, lambda sample: sample.flying).sequence == 901
    nothing_lost(telemetry)


def test_the_bridge_publishes_and_answers_as_it_is_told(hero_domain, hero_bridge):
    robot = hero_domain.join()
    state, raw = robot.module_state(), robot.dsp_telemetry()
    hero_bridge.state.publish(structs.ModuleState(module_id=1))
    hero_bridge.telemetry.publish(structs.DspTelemetry(received_ns=7))
    assert until(state, lambda sample: True).module_id == 1
    assert until(raw, lambda sample: True).received_ns == 7

    assert robot.start().wait().stage == "done"
    assert hero_bridge.control.next_request().command == structs.ControlCommand.START
    assert final_report(robot.send("parameters", structs.ParameterRequest())).stage == "done"
    hero_bridge.movement.answer_next(lambda order: order.refuse("busy"))
    with pytest.raises(RequestFailed, match="busy"):
        robot.take_off(3).wait()
    assert hero_bridge.movement.next_request().altitude_m == 3
    hero_bridge.movement.answer_next("hang")
    landing = robot.land()
    assert hero_bridge.movement.next_request().kind == structs.MovementKind.LAND
    assert landing.next(0.05) is None
    hero_bridge.movement.hanging()[0].done()
    assert final_report(landing).stage == "done"
    hero_bridge.movement.answer_next("die")
    assert final_report(robot.hold()).stage == "unknown"
