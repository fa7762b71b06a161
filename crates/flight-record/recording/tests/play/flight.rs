//! What of a file is played.

use recording::play::{FlightError, FlightNs, PlayedContent, REQUEST_EVENT};

use crate::made::{Made, START_MS, flight_of};

fn flight_ms(ms: u64) -> Option<FlightNs> {
    Some(FlightNs((START_MS + ms) * 1_000_000))
}

#[test]
fn samples_and_requests_are_played_and_what_the_recorder_made_is_not() {
    let mut made = Made::new();
    let state = made.values("/robot7/battery/state");
    let journal = made.values("/robot7/bridge/journal");
    let other = made.values("/robot8/battery/state");
    let fix = made.channel("/robot7/fix", "sensor_msgs/msg/NavSatFix", "string frame\n");
    let requests = made.channel("/robot7/requests", REQUEST_EVENT, "uint64 at_ns\n");
    made.value(state, 0, 0, 1);
    made.value(journal, 1, 0, 1);
    made.value(other, 1, 0, 1);
    made.message(fix, 2, &[0, 1, 0, 0, 9]);
    made.message(requests, 3, &[0, 1, 0, 0, 8]);
    made.value(state, 4, 0, 2);
    // Of another length than its schema says.
    made.message(state, 5, &[0, 1, 0, 0, 1]);
    let flight = made.flight();
    assert_eq!(flight.robot().get(), 7);
    assert_eq!(flight.messages(), 3);
    let topics: Vec<&str> = flight.topics().iter().map(|topic| &*topic.key).collect();
    assert_eq!(topics, ["battery/state"]);
    assert_eq!(flight.topics()[0].moments, [16]);
    assert!(matches!(flight.content(0), Some(PlayedContent::Sample(0, sample)) if sample[0] == 1));
    assert_eq!(
        flight.content(1),
        Some(PlayedContent::Request(&[0, 1, 0, 0, 8]))
    );
    assert!(matches!(flight.content(2), Some(PlayedContent::Sample(0, sample)) if sample[0] == 2));
    assert_eq!(
        [0, 1, 2, 3].map(|index| flight.at(index)),
        [flight_ms(0), flight_ms(3), flight_ms(4), None]
    );
    let left_out: Vec<&str> = flight.left_out().iter().map(|one| &*one.topic).collect();
    assert_eq!(left_out, ["/robot8/battery/state"]);
    assert!(flight.errors().is_empty(), "{:?}", flight.errors());
}

#[test]
fn a_sample_passes_at_the_latest_moment_in_it_and_a_topic_keeps_its_order() {
    let mut made = Made::new();
    let (one, two) = (made.values("/robot7/a/one"), made.values("/robot7/a/two"));
    // Recorded by the moment of the measurement, published 3 ms later.
    made.value(one, 10, 13, 1);
    made.value(two, 11, 11, 2);
    made.value(one, 12, 12, 3);
    // Moments far ahead are no times of publication.
    made.value(two, 14, 90_000, 4);
    let flight = made.flight();
    let values = (0..4).filter_map(|index| match flight.content(index)? {
        PlayedContent::Sample(_, sample) => Some(sample[24]),
        PlayedContent::Request(_) => None,
    });
    assert_eq!(values.collect::<Vec<_>>(), [2, 1, 3, 4]);
    assert_eq!(
        [0, 1, 2, 3].map(|index| flight.at(index)),
        [11, 13, 13, 14].map(flight_ms)
    );
}

#[test]
fn what_is_no_recording_is_refused_and_what_is_cut_is_played_as_far_as_it_goes() {
    assert!(matches!(
        flight_of(b"no recording"),
        Err(FlightError::Read(_))
    ));
    assert!(matches!(
        flight_of(&Made::new().file()),
        Err(FlightError::NoSamples)
    ));
    let mut made = Made::new();
    let topic = made.values("/robot7/a/one");
    for value in 0..100 {
        made.value(topic, value, 0, value);
    }
    let file = made.file();
    assert_eq!(flight_of(&file).expect("a flight").messages(), 100);
    for len in (0..file.len()).step_by(97) {
        if let Ok(flight) = flight_of(&file[..len]) {
            assert!(flight.messages() <= 100);
        }
    }
}
