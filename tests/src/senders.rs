//! Programs in the languages of the bindings that order a path and follow it to its end, to be killed or stopped
//! meanwhile. Each is called with a latitude, degrees, and a lease, ms, or 0.

use std::ffi::OsString;
use std::path::Path;

use crate::languages::{Compiler, python};

const IN_C: &str = r#"
#include <stdio.h>
#include <stdlib.h>
#include <hero_ril.h>

int main(int argc, char **argv) {
    hero_ril_robot *robot = NULL;
    hero_ril_client *client = NULL;
    hero_ril_waypoint far_away = {atof(argv[argc - 2]), -6.0010, 25.0};
    RequestReport report = {0};
    uint64_t id;
    if (hero_ril_join(NULL, 1, "killed", &robot) != HERO_RIL_OK || hero_ril_client_open(robot, &client) != HERO_RIL_OK ||
        hero_ril_when_lost(client, 0, atoi(argv[argc - 1])) != HERO_RIL_OK ||
        hero_ril_go_to(client, &far_away, 1, 0, &id) != HERO_RIL_OK) {
        fprintf(stderr, "%s\n", hero_ril_last_error());
        return 1;
    }
    while (!hero_ril_is_final(&report)) {
        hero_ril_next_report(client, id, 50, &report);
    }
    fprintf(stderr, "%s\n", hero_ril_reason_name(report.reason));
    return 1;
}
"#;

/// As [`IN_C`].
const IN_CPP: &str = r#"
#include <array>
#include <cstdlib>
#include <iostream>
#include <hero_ril.hpp>

int main(int argc, char **argv) try {
    hero_ril::Robot robot("killed");
    auto client = robot.client();
    client.when_lost(0, std::atoi(argv[argc - 1]));
    client.go_to(std::array{hero_ril::Waypoint{std::atof(argv[argc - 2]), -6.0010, 25.0}}).finish();
    return 0;
} catch (const std::exception &error) {
    std::cerr << error.what() << '\n';
    return 1;
}
"#;

/// As [`IN_C`].
const IN_PYTHON: &str = r#"
import sys
import hero_ril

with hero_ril.Robot(1, name="killed") as robot:
    latitude, lease_s = float(sys.argv[1]), int(sys.argv[2]) / 1000
    if lease_s:
        robot.when_lost(lease_s=lease_s)
    request = robot.go_to((latitude, -6.0010, 25.0))
    while request.final is None:
        request.next(timeout=0.05)
    sys.exit(str(request.final))
"#;

/// The languages that have such a program.
pub const LANGUAGES: [&str; 3] = ["C", "C++", "Python"];

/// Builds the program of one of the [`LANGUAGES`] in `folder`. Gives the beginning of its command line.
///
/// # Errors
///
/// What this machine lacks for it.
///
/// # Panics
///
/// When a compiler rejects it, and for another language.
pub fn path_sender(language: &str, folder: &Path) -> Result<Vec<OsString>, String> {
    let built = |compiler: Compiler, name: &str, text: &str| {
        let (source, program) = (folder.join(name), folder.join(name).with_extension("built"));
        std::fs::write(&source, text).expect("a file");
        compiler.with_shared_library(source.to_str().expect("a path in UTF-8"), &program);
        vec![program.into_os_string()]
    };
    match language {
        "C" => Compiler::c().map(|compiler| built(compiler, "sender.c", IN_C)),
        "C++" => Compiler::cpp().map(|compiler| built(compiler, "sender-cpp.cpp", IN_CPP)),
        "Python" => {
            let words = ["-u", "-c", IN_PYTHON].map(OsString::from);
            let python = python().map_err(str::to_owned)?.as_os_str().to_owned();
            Ok([python].into_iter().chain(words).collect())
        }
        other => panic!("no program in {other}"),
    }
}
