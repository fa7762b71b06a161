//! What a test expects of a topic or a request: waited for, and told in words when it does not come.

use ipc_types::payload::RequestReport;
use ipc_types::{Client, Request, Subscriber, Topic};

use crate::process::WAIT_LIMIT;

/// Reads until a sample is as `wanted` says, and returns it. Those before it are gone.
///
/// # Panics
///
/// When none comes within [`WAIT_LIMIT`], or samples cannot be received.
#[track_caller]
pub fn until<T: Topic>(subscriber: &mut Subscriber<T>, mut wanted: impl FnMut(&T) -> bool) -> T {
    let mut found = None;
    while found.is_none() {
        let wake = subscriber.wait(WAIT_LIMIT).expect("a wait");
        assert!(
            wake.is_ready(),
            "no sample of {} came as it is wanted",
            T::KEY
        );
        let taken = subscriber.drain(|sample| {
            if found.is_none() && wanted(sample) {
                found = Some(*sample);
            }
        });
        taken.expect("samples that can be received");
    }
    found.expect("the loop ends with it")
}

/// Reads the next `count` samples, and those that came with the last of them.
///
/// # Panics
///
/// When they do not come within [`WAIT_LIMIT`] each, or cannot be received.
#[track_caller]
pub fn samples<T: Topic>(subscriber: &mut Subscriber<T>, count: usize) -> Vec<T> {
    let mut samples = Vec::new();
    while samples.len() < count {
        let wake = subscriber.wait(WAIT_LIMIT).expect("a wait");
        let read = samples.len();
        assert!(
            wake.is_ready(),
            "{read} of {count} samples of {} came",
            T::KEY
        );
        let taken = subscriber.drain(|sample| samples.push(*sample));
        taken.expect("samples that can be received");
    }
    samples
}

/// Asserts that the subscriber got every sample that was published since it began.
///
/// # Panics
///
/// When one was lost, or came before it joined; with the counts.
#[track_caller]
pub fn nothing_lost<T: Topic>(subscriber: &Subscriber<T>) {
    let losses = subscriber.losses();
    let (lost, missed) = (losses.lost, losses.joined_late);
    assert_eq!((lost, missed), (0, 0), "of {}: {losses:?}", T::KEY);
}

/// Sends a request and follows it to its end: asserts that the last report is the only final one, and returns all.
///
/// # Panics
///
/// When it cannot be sent, no final report comes within [`WAIT_LIMIT`], or another report follows the final one.
#[track_caller]
pub fn one_final_report<R: Request>(client: &mut Client<R>, request: &R) -> Vec<RequestReport> {
    client.send(request).expect("a request that can be sent");
    let mut reports: Vec<RequestReport> = Vec::new();
    while client.outstanding() > 0 {
        let wake = client.wait(WAIT_LIMIT).expect("a wait");
        assert!(
            wake.is_ready(),
            "no final report of {} after {reports:?}",
            R::KEY
        );
        client.drain(|report| reports.push(*report));
    }
    let finals = reports.iter().filter(|report| report.is_final()).count();
    let is_last = reports.last().is_some_and(RequestReport::is_final);
    assert!(
        finals == 1 && is_last,
        "one final report of {}: {reports:?}",
        R::KEY
    );
    reports
}
