//! Missions over a real socket: whole or not at all when the gateway is killed. `endurance` sends them over a bad line.

use endurance::mavlink::mission::{contents, download, mission, upload, upload_until};
use endurance::mavlink::station::Station;
use ril_tests::process::Signal;

use super::{gateway, sandbox};
use crate::common::end;

#[test]
fn a_gateway_that_is_killed_at_any_step_of_an_upload_has_the_old_mission_or_the_new_one() {
    const ITEMS: usize = 3;
    let rig = sandbox();
    let robot = rig.start_robot(1, 1);
    let missions = [mission(ITEMS as u16, 15.0), mission(ITEMS as u16, 16.0)];
    let mut station = Station::new();
    let mut process = gateway(&rig, station.port(), 60.0);
    station.connect();
    assert_eq!(upload(&mut station, &missions[0]), 0);
    let mut kept = 0;
    // Killed after the count, after each item, and after the answer.
    for sent in 0..=ITEMS + 1 {
        let other = 1 - kept;
        let stop = (sent <= ITEMS).then_some(sent);
        let answer = upload_until(&mut station, &missions[other], stop);
        assert_eq!(answer, (sent > ITEMS).then_some(0));
        rig.kill(process);
        process = gateway(&rig, station.port(), 60.0);
        station.reconnect();
        let found = download(&mut station);
        let is = |which: usize| found == contents(&missions[which]);
        match sent {
            // On its way to the disk.
            ITEMS => assert!(is(kept) || is(other), "{found:?}"),
            sent if sent > ITEMS => assert!(is(other), "{found:?}"),
            _ => assert!(is(kept), "{sent} items: {found:?}"),
        }
        kept = if is(other) { other } else { kept };
    }
    end(process, Signal::TERM);
    robot.end();
}
