//! `ril param` with the real bridge; the rest is in `ril/parameters.rs`.

use ipc_types::code::LinkState;
use ril_tests::process::Signal;

use super::station::on_terminal;
use crate::common::{end, json, sandbox};

#[test]
fn the_list_has_values_and_without_a_link_it_says_why_it_has_none() {
    let rig = sandbox();
    let sim = rig.sim(1, "");
    let bridge = rig.bridge(1);
    rig.watch(1).until_ready();
    let lines = on_terminal(&rig, "param list", 0);
    let set = rig.run("param set cruise_speed_mps 7.5 --json", 0).stdout;
    let last = json(set.last().unwrap());
    assert_eq!(
        (&last["value"], &last["previous_value"]),
        (&7.5.into(), &5.0.into())
    );

    end(sim, Signal::INT);
    rig.watch(1).until("the port is gone", |state| {
        state.link.state() == Some(LinkState::Gone)
    });
    let finished = rig.run("param list", 6);
    assert_eq!(finished.stdout.len(), lines.len(), "{finished:#?}");
    finished.err_says("the values could not be read");
    let finished = rig.run("param list --no-values --json", 0);
    assert_eq!(finished.stdout.len(), lines.len() - 1);
    end(bridge, Signal::INT);
    rig.run("param list", 3);
}
