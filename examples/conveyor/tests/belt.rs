//! Publisher, consumer and request server against stand-ins alone.

use std::time::Duration;

use conveyor::{Belt, Counter, Motor, PERIOD, SetSpeed};
use ipc_fixtures::process::{Signal, WAIT_LIMIT};
use ipc_fixtures::{
    Answer, Garbage, Process, Scenario, StandInServer, TestDomain, VirtualTime, expect,
};
use ipc_types::code::{Reason, Stage};
use ipc_types::{Removal, fresh_request_id};

const SECOND: Duration = Duration::from_secs(1);

fn set(speed_mps: f64) -> SetSpeed {
    SetSpeed {
        request_id: fresh_request_id(),
        speed_mps,
    }
}

/// The belt at 2 m/s, from 0 on.
fn running(length: Duration) -> Scenario<Belt> {
    Scenario::every(PERIOD).run(length, |at| Belt {
        speed_mps: 2.0,
        moved_m: 2.0 * at.as_secs_f64(),
        ..Belt::default()
    })
}

#[test]
fn an_hour_of_the_motor_takes_no_time() {
    let (mut motor, mut time) = (Motor::default(), VirtualTime::new());
    motor.set(&set(0.5));
    let mut belt = Belt::default();
    time.run(3600 * SECOND, |now| {
        belt = motor.step(now);
        Some(now + PERIOD)
    });
    assert!((belt.moved_m - 1800.0).abs() < 0.02, "{belt:?}");
    for speed in [-0.1, 3.1, f64::NAN] {
        assert_eq!(motor.set(&set(speed)).reason(), Some(Reason::OutOfRange));
    }
}

#[test]
fn the_counter_loses_nothing_of_a_script_that_is_longer_than_a_queue() {
    let domain = TestDomain::new();
    let mut counter = Counter::open(&domain.join("counter")).unwrap();
    let playing = running(20 * SECOND).play(&domain);
    assert_eq!(counter.wait_for_metres(39.95, WAIT_LIMIT).unwrap(), 1000);
    playing.finish();
}

#[test]
fn the_counter_goes_on_after_garbage_silence_and_the_death_of_the_drive() {
    let domain = TestDomain::new();
    let mut counter = Counter::open(&domain.join("counter")).unwrap();
    let again = running(20 * SECOND);
    let scenario = running(SECOND).stall(SECOND / 10).restart();
    let playing = again
        .samples()
        .fold(scenario, |all, sample| all.run(PERIOD, |_| *sample));
    let playing = playing.garbage(7, 100).play(&domain);
    counter.wait_for_metres(41.0, WAIT_LIMIT).unwrap();
    playing.finish();
}

#[test]
fn the_drive_moves_the_belt_as_it_is_asked_and_says_so_once() {
    let domain = TestDomain::new();
    let ipc = domain.join("test");
    let mut belt = ipc.subscriber::<Belt>().unwrap();
    let mut client = ipc.client::<SetSpeed>().unwrap();
    let mut drive = Process::start::<&str>(&domain, env!("CARGO_BIN_EXE_conveyor"), []);
    drive.wait_for_text("ready");
    for (speed, stage) in [(1.5, Stage::Done), (9.0, Stage::Refused)] {
        let reports = expect::one_final_report(&mut client, &set(speed));
        assert_eq!(reports.last().unwrap().stage(), Some(stage));
    }
    // Requests of any bit pattern get their one report, too.
    let mut garbage = Garbage::new(7);
    for _ in 0..20 {
        let any: SetSpeed = garbage.payload();
        expect::one_final_report(&mut client, &set(any.speed_mps));
    }
    let reports = expect::one_final_report(&mut client, &set(1.5));
    assert_eq!(reports.last().unwrap().stage(), Some(Stage::Done));
    expect::until(&mut belt, |sample| {
        sample.speed_mps == 1.5 && sample.moved_m > 0.1
    });
    expect::nothing_lost(&belt);
    drive.signal(Signal::KILL);
    drive.wait_status();
    drop((belt, client, ipc));
    assert_ne!(domain.sweep(), Removal::InUse);
}

#[test]
fn a_client_learns_of_a_drive_that_hangs_refuses_or_dies() {
    let domain = TestDomain::new();
    let drive = StandInServer::<SetSpeed>::start(&domain);
    let mut client = domain.join("operator").client::<SetSpeed>().unwrap();
    drive.answer_next(Answer::refuse(Reason::Busy));
    let reports = expect::one_final_report(&mut client, &set(1.0));
    assert_eq!(reports[0].reason(), Some(Reason::Busy));
    drive.answer_next(Answer::Hang);
    let mut handle = client.request(&set(2.0)).unwrap();
    let nothing = handle.result_timeout(Duration::from_millis(50)).unwrap();
    assert_eq!(nothing, None);
    drop(handle);
    drive.answer_next(Answer::Die);
    let reports = expect::one_final_report(&mut client, &set(3.0));
    assert_eq!(reports[0].stage(), Some(Stage::Unknown));
}
