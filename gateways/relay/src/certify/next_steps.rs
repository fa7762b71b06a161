//! What the user has to do with the certificates: lines for relay.toml, with comments that say the rest.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::num::NonZeroU32;
use std::path::Path;

use time::Date;

use super::machine::Machine;

/// The number of a robot that is called `robot-<number>`.
fn robot_number(name: &str) -> Option<NonZeroU32> {
    name.strip_prefix("robot-")?.parse().ok()
}

fn is_router(name: &str) -> bool {
    name.starts_with("router")
}

/// The text for `machines`. `names` are those of all machines that have certificates; `authority_key` is a file, and `until` the day
/// on which the authority ends.
pub(super) fn next_steps(
    machines: &[Machine],
    names: &BTreeSet<String>,
    authority_key: &Path,
    until: Date,
) -> String {
    let list = |names: Vec<String>| names.join(", ");
    let (robots, others): (Vec<&String>, Vec<&String>) =
        names.iter().partition(|name| robot_number(name).is_some());
    let (routers, stations): (Vec<&String>, Vec<&String>) =
        others.into_iter().partition(|name| is_router(name));
    let robots = robots
        .iter()
        .filter_map(|name| Some(format!("{name} = {}", robot_number(name)?)));
    let quoted = |names: Vec<&String>| list(names.iter().map(|name| format!("{name:?}")).collect());
    let common = format!(
        "robots = {{ {} }}\nrouters = [{}]\nstations = [{}]\n",
        list(robots.collect()),
        quoted(routers),
        quoted(stations),
    )
    .replace("{  }", "{}");
    let mut text = format!(
        "# The authority holds until {}. Keep {} secret: it signs whatever it is asked to.\n\
         # A name `robot-<number>` is taken for that robot, `router…` for a router, any other for a station.\n\
         # A station that may command is named in `[commands]` too: commands.stations = [\"…\"]\n",
        until,
        authority_key.display(),
    );
    for machine in machines {
        let name = &machine.name;
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            "\n# For `{name}`, onto which ca.pem, {name}.pem and {name}-key.pem are copied; the paths are those on that machine.\n\
             [security]\nauthority = \"ca.pem\"\ncertificate = \"{name}.pem\"\nkey = \"{name}-key.pem\"\n{common}"
        );
        if machine.hosts.is_empty() {
            let _ = writeln!(
                text,
                "# Others can connect to it as `{name}` alone; for addresses: {name}=10.0.0.2,host.example"
            );
        }
    }
    text
}
